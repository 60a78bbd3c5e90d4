#!/usr/bin/env bash
# usage: ends_test.sh PROGRAM, beside which lies PROGRAM-study. How each command that computes ends by a signal, and what it says on a full disk. A table; exit code 1
# if a row is wrong. Commands that need devices: tests/drivers/program and tests/hardware.
set -uo pipefail
program=$(realpath "$1") study=$(realpath "$1-study") failed=0
work=$(mktemp -d)
trap 'umount "$work/full" 2>/dev/null; rm -rf "$work"' EXIT
cd "$work" || exit 1
"$study" simulate --flight standstill --duration 4 --out images --quiet || exit 1
"$study" simulate --tracks --flight survey --out tracks --quiet || exit 1

mkfifo board # nothing comes from it

# with COMMAND: the program that has it.
with() { if [[ $1 == simulate ]]; then echo "$study"; else echo "$program"; fi; }

milliseconds() { echo $((${EPOCHREALTIME/./} / 1000)); }

# row COMMAND HOW TIME CODE WRONG: prints it; WRONG is empty if all is well.
row() {
  printf '%-11s %-10s %5s ms  rc %3d  %s%s\n' "$1" "$2" "$3" "$4" "$(tail -n 1 err | cut -c1-110)" "${5:+  WRONG: $5}"
  [[ -z $5 ]] || failed=1
}

# handles_signals PID COMMAND: whether it is the program, not yet the shell before it, and has a handler for SIGTERM.
handles_signals() {
  [[ $(readlink "/proc/$1/exe") == "$(with "$2")" ]] && ((0x$(awk '/^SigCgt/ { print $2 }' "/proc/$1/status") & 1 << 14))
}

# ended COMMAND SIGNALS CODE TEXT LEFT BEGUN ARGUMENTS...: sends the signals at a random time once there is a file BEGUN. It ends with
# CODE and TEXT, and with the files LEFT, long before the minutes that it would go on for (0.2 s where nothing else runs).
ended() {
  local command=$1 signals=$2 code=$3 text=$4 left=$5 begun=$6 begin rc wrong="" pid signal
  shift 6
  rm -rf out
  # a shell lets what runs in the background ignore SIGINT
  env --default-signal=INT,TERM,HUP "$(with "$command")" "$command" "$@" >/dev/null 2>err </dev/null &
  pid=$!
  for ((i = 0; i < 3000; ++i)); do
    compgen -G "$begun" >/dev/null && handles_signals "$pid" "$command" && break
    sleep 0.01
  done
  sleep "0.$((RANDOM % 9))"
  begin=$(milliseconds)
  for signal in $signals; do kill "-$signal" "$pid" 2>/dev/null || wrong="it had ended before"; done
  wait "$pid"
  rc=$?
  local took=$(($(milliseconds) - begin))
  ((took < 20000)) || wrong="it went on"
  ((rc == code)) || wrong="code; expected $code"
  [[ $(<err) == *"$text"* ]] || wrong="no \"$text\""
  for file in $left; do [[ -s out/$file ]] || wrong="no $file"; done
  [[ -z $(find out -name '*.partial' -o -name '*.epiline-new' 2>/dev/null) ]] || wrong="half a result"
  row "$command" "${signals// /+}" "$took" "$rc" "$wrong"
}

for signals in INT TERM 'TERM TERM'; do
  name=SIG${signals%% *} number=$(kill -l "${signals%% *}")
  ended replay "$signals" 1 "ended by $name after" 'stats.json report.html events.txt' out/records images --realtime \
    --record out/records --loop 60 --out out
  ended simulate "$signals" 1 "ended by $name after" 'mav0/cam0/data.csv mav0/imu0/data.csv' 'out/mav0.partial/cam0/data/*.png' \
    --flight hall --out out
  ended calibrate "$signals" $((128 + number)) "ended by $name, nothing was written" '' . tracks --board board --out out
done

# full COMMAND ARGUMENTS...: with a full disk behind stdout, then (root only) behind --out.
full() {
  local rc wrong="" begin
  for where in stdout --out; do
    [[ $where == stdout || $EUID == 0 ]] || continue
    wrong="" begin=$(milliseconds)
    if [[ $where == stdout ]]; then
      [[ $1 != simulate ]] || continue # it prints nothing
      rm -rf out
      "$(with "$1")" "${@//OUT/out}" >/dev/full 2>err
    else
      [[ $* == *--out* ]] || continue
      rm -rf full/*
      "$(with "$1")" "${@//OUT/full/out}" >/dev/null 2>err
    fi
    rc=$?
    ((rc == 1 || rc == 2)) || wrong="code; expected 1 or 2"
    grep -q '^epiline: error: ' err || wrong="no error"
    [[ -z $(find out full -name '*.partial' -o -name '*.epiline-new' 2>/dev/null) ]] || wrong="half a result"
    row "$1" "$where full" "$(($(milliseconds) - begin))" "$rc" "$wrong"
  done
}

mkdir full
((EUID == 0)) && { mount -t tmpfs -o size=4k t full && head -c 4096 /dev/zero >full/.filled || exit 1; }
full replay images --out OUT
full simulate --tracks --flight hover --out OUT
full board --out OUT.pdf
full evaluate images/mav0/state_groundtruth_estimate0/data.csv images/mav0/state_groundtruth_estimate0/data.csv
full config
full dbc
full devices
full init --out OUT.toml
exit "$failed"
