#!/usr/bin/env bash
# usage: live_ends.sh PROGRAM FLIGHT. In the machine of tests/hardware/vm: how run, record, check and hil end by a signal while
# their devices deliver, and what they do on a full disk. A table; exit code 1 if a row is wrong. The other commands:
# tests/package/ends_test.sh.
set -uo pipefail
program=$1 flight=$2 failed=0 player=
work=$(mktemp -d) line=/run/controller
cd "$work" || exit 1
cat >live.toml <<TOML
[camera]
device = "/dev/video42"
rate_hz = 20
trust_stamps = true
stamp_point = "start-of-exposure"
calibration = "$flight/mav0/cam0/sensor.yaml"
[imu]
calibration = "$flight/mav0/imu0/sensor.yaml"
rate_hz = 200
driver = "iio"
device = "gyro_3d"
device_accel = "accel_3d"
[mavlink]
serial = "$line"
TOML
mkdir full
mount -t tmpfs -o size=64k full full || exit 1

milliseconds() { echo $((${EPOCHREALTIME/./} / 1000)); }
played=(hil "$flight" --config live.toml --camera v4l2loopback:/dev/video42 --imu uhid --controller "pty:$line")

play() {
  "$program" "${played[@]}" --beside >player.txt 2>player.err &
  player=$!
  until grep -q '^ready' player.txt; do kill -0 $player && sleep 0.1 || exit 1; done
}

stop_playing() {
  kill $player 2>/dev/null
  wait $player
}

# row COMMAND HOW TIME CODE WRONG: prints it; WRONG is empty if all is well.
row() {
  printf '%-7s %-28s %5s ms  rc %3d  %s%s\n' "$1" "$2" "$3" "$4" "$(tail -n 1 err | cut -c1-110)" "${5:+  WRONG: $5}"
  [[ -z $5 ]] || failed=1
}

# flies COMMAND OUT: whether the command has data of its devices.
flies() {
  case $1 in
    run | hil) (($(wc -l <"$2/trajectory.tum") > 20)) ;;
    record) [[ -s $2/mav0/cam0/data.csv ]] && (($(wc -l <"$2/mav0/cam0/data.csv") > 20)) ;;
    check) [[ -e begun ]] ;;
  esac 2>/dev/null
}

# newest COMMAND OUT: when the newest sample on the disk was taken, in ms of the machine's clock.
newest() {
  case $1 in
    run | hil) awk 'END { printf "%d\n", 1000 * $1 }' "$2/trajectory.tum" ;;
    record) awk -F, 'END { printf "%d\n", $1 / 1000000 }' "$2/mav0/imu0/data.csv" ;; # images wait here: they are compressed slowly
  esac
}

# left COMMAND OUT: what is missing of what the command leaves.
left() {
  local file files=()
  case $1 in
    run) files=(trajectory.tum events.txt stats.json report.html) ;;
    record) files=(mav0/cam0/data.csv mav0/imu0/data.csv) ;;
    hil) files=(trajectory.tum stats.json report.html verdict.txt received.tum) ;;
    check) grep -qE '^(ok|warning) +imu:' text && grep -qE '^ok +camera:' text || echo "no findings" ;;
  esac
  for file in "${files[@]}"; do [[ -s $2/$file ]] || echo "no $file"; done
  [[ $1 != record ]] || (($(grep -vc '^#' "$2/mav0/cam0/data.csv") == $(ls "$2/mav0/cam0/data" | wc -l))) || echo "images without a line"
  [[ -z $(find "$2" -name '*.partial' -o -name '*.epiline-new' 2>/dev/null) ]] || echo "half a result"
}

# ended COMMAND HOW SIGNAL CODES OUT ARGUMENTS...: sends the signal once data has come. HOW: "terminal": stdout is one; else the file
# that stdout is. It ends with a code of CODES, within 0.5 s of a machine that is five times slower than a computer, and with all up
# to the last 0.3 s on the disk, if OUT is no full one. A recording onto a full disk ends by itself.
ended() {
  local full=""
  [[ $5 != full/* ]] || full="--out full"
  local command=$1 how=$2 signal=$3 codes=$4 out=$5 begin took rc wrong="" pid waits clock age=0
  shift 5
  [[ $out == none ]] || rm -rf "$out"
  rm -f pid begun text err
  if [[ $how == terminal ]]; then
    script -qec "echo \$\$ >pid; exec $program $command $* 2>err" text >script.txt </dev/null &
    waits=$!
    until [[ -s pid ]]; do sleep 0.1; done
    pid=$(<pid)
  else
    env --default-signal=INT,TERM,HUP "$program" "$command" "$@" >"$how" 2>err </dev/null &
    pid=$! waits=$pid
  fi
  [[ $command != check ]] || { sleep 3.5; : >begun; }
  for ((i = 0; i < 300; ++i)); do
    flies "$command" "$out" || [[ $out == full/* && $i -ge 60 ]] && break
    kill -0 "$pid" 2>/dev/null || break
    sleep 0.1
  done
  sleep "0.$((RANDOM % 9))"
  clock=$(awk '{ printf "%d\n", 1000 * $1 }' /proc/uptime) begin=$(milliseconds)
  kill "-$signal" "$pid" 2>/dev/null || [[ "$command $out" == "record full"* ]] || wrong="it had ended before"
  wait "$waits"
  rc=$?
  took=$(($(milliseconds) - begin))
  ((took < 500)) || wrong="too slow"
  [[ $rc == [$codes] ]] || wrong="code; expected $codes"
  ((rc == 0)) || grep -q '^epiline: error: ' err || wrong="no error"
  if [[ $out != full/* ]]; then
    [[ $how != /dev/full || $command != check ]] && wrong+=$(left "$command" "$out")
    [[ $command == check ]] || age=$((clock - $(newest "$command" "$out")))
    ((age < 300)) || wrong+="the newest sample is $age ms old"
  fi
  row "$command" "SIG$signal, $how${full:+, $full}" "$took" "$rc" "$wrong"
}

# all_ways COMMAND CODE OUT ARGUMENTS...
all_ways() {
  local command=$1 code=$2 out=$3
  shift 3
  ended "$command" text INT "$code" "$out" "$@"
  ended "$command" text TERM "$code" "$out" "$@"
  ended "$command" terminal HUP "$code" "$out" "$@"
}

hil=(--duration 60 --config live.toml --camera v4l2loopback:/dev/video42 --imu uhid --controller "pty:$line")
all_ways hil 0 flown "$flight" "${hil[@]}" --out flown
ended hil /dev/full TERM 12 flown "$flight" "${hil[@]}" --out flown
ended hil text TERM 12 full/out "$flight" "${hil[@]}" --out full/out
rm -rf full/out

play
all_ways run 0 flown --config live.toml --out flown
all_ways record 0 taken --config live.toml --out taken
all_ways check 1 none --config live.toml --seconds 60
stop_playing
play
# without a terminal SIGHUP ends nothing
rm -rf flown
"$program" run --config live.toml --out flown >text 2>err &
pid=$!
until flies run flown; do kill -0 $pid && kill -0 $player && sleep 0.1 || exit 1; done
if kill -HUP $pid && sleep 1 && kill -0 $pid; then
  echo "run     SIGHUP, no terminal    goes on"
else
  echo "SIGHUP without a terminal ended the flight"
  failed=1
fi
kill $pid
wait $pid
ended run /dev/full TERM 12 flown --config live.toml --out flown
ended run text TERM 12 full/out --config live.toml --out full/out
rm -rf full/out
ended record /dev/full TERM 12 taken --config live.toml --out taken
ended record text TERM 12 full/out --config live.toml --keep-free 0 --out full/out
ended check /dev/full TERM 12 none --config live.toml --seconds 60
stop_playing
exit $failed
