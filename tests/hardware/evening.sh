#!/bin/sh
# usage: evening.sh PROGRAM record BOARD CAMERA SECONDS | evening.sh PROGRAM fly FLIGHT SECONDS |
# evening.sh PROGRAM live BOARD CAMERA SECONDS. In the machine of tests/hardware/vm: what a user does in an evening, with no file written by hand. `record`: devices, init and record, before a
# waved board (BOARD, made by `flights calibrations --write`, CAMERA the calibration it was made with). `epiline calibrate
# --config` comes between the two, outside, where a processor has its full speed. `fly`: check, and a flight through the
# kernel's interfaces, accepted by the controller's model and true to 5 cm. `live`: what also works on devices alone, the page
# of `check` with a finding that is accepted there, and a calibration without a recording made before.
set -eu
program=$1 phase=$2
shift 2
out=/out
line=/run/controller
# v4l2loopback does not declare its clock, and the controller is at the end of a pseudo terminal
sets="--set camera.trust_stamps=true --set camera.stamp_point=start-of-exposure --set mavlink.serial=$line"
player=
# The machine's clock goes on while it waits for this computer's disk, so nothing is left to be read when a device plays.
cat "$program" $(ldd "$program" | awk '/=> \// { print $3 }') >/dev/null

fail() {
  echo "evening: $*" >&2
  tail -n 5 "$out"/*.err >&2
  exit 1
}

# play DATASET CAMERA SECONDS: returns when the devices are there.
play() {
  printf '[camera]\ncalibration = "%s"\n[mavlink]\nserial = "%s"\n' "$2" "$line" >"$out/player.toml"
  "$program" hil "$1" --config "$out/player.toml" --beside --camera v4l2loopback:/dev/video42 --imu uhid \
    --controller "pty:$line" --duration "$3" --out "$out/player" >"$out/player.txt" 2>"$out/player.err" &
  player=$!
  while ! grep -q '^ready' "$out/player.txt" && kill -0 $player 2>/dev/null; do sleep 0.1; done
}

# The player waits for ever for somebody who takes what it plays, and may have ended with the recording.
stop_playing() {
  kill $player 2>/dev/null || true
  wait $player || true
}

# user WORDS...: a command as the user types it, and what it prints.
user() {
  echo "\$ epiline $*"
  "$program" "$@" 2>"$out/user.err" || fail "epiline $1 failed"
}

record() {
  play "$1" "$2" "$3"
  user devices
  rm -f "$out/epiline.toml"
  user init --out "$out/epiline.toml"
  rm -rf "$out/board"
  user record --config "$out/epiline.toml" $sets --out "$out/board" --duration "$3"
  stop_playing
}

# page PATH FILE [OPTIONS...]: of the check that is under way, as a browser asks.
page() {
  from=$1 to=$2
  shift 2
  curl -fsS --max-time 20 "$@" "http://127.0.0.1:8080$from" >"$out/$to" 2>>"$out/page.err"
}

# A wrong time offset, as if the configuration had it: the page offers the right one, and writes it when asked by itself only.
accept() {
  post="/accept?setting=camera.time_offset_s"
  until page /state state.json && grep -q '"setting":"camera.time_offset_s"' "$out/state.json"; do
    kill -0 $checker 2>/dev/null || fail "the page offers no time offset"
    sleep 0.5
  done
  key=$(sed -n 's/.*const KEY = "\([^"]*\)".*/\1/p' "$out/page.html")
  cp "$out/epiline.toml" "$out/before.toml"
  if page "$post" stranger.txt -X POST -H "X-Epiline-Key: guess" || page "$post" stranger.txt; then
    fail "the page let a stranger write"
  fi
  cmp "$out/epiline.toml" "$out/before.toml" || fail "a stranger has written"
  page "$post" accepted.txt -X POST -H "Content-Length: 0" -H "X-Epiline-Key: $key" || fail "the page did not write"
  page /state state.json
  grep -q 'time_offset_s = .* is in the configuration' "$out/state.json" || fail "the page does not say that it wrote"
  cmp "$out/epiline.toml.bak.1" "$out/before.toml" || fail "the configuration was not kept as it was"
  grep '^time_offset_s = ' "$out/epiline.toml" || fail "the time offset is not in the configuration"
  grep -v '^time_offset_s = ' "$out/epiline.toml" | cmp - "$out/before.toml" || fail "more has changed than the time offset"
}

live() {
  play "$1" "$2" "$3"
  echo "\$ epiline check --config $out/epiline.toml --set camera.time_offset_s=0.03 --view 8080"
  "$program" check --config "$out/epiline.toml" $sets --set camera.time_offset_s=0.03 --view 8080 --seconds 11 \
    >"$out/check.txt" 2>"$out/check.err" &
  checker=$!
  until page / page.html; do
    kill -0 $checker 2>/dev/null || fail "the check ended without a page"
    sleep 0.2
  done
  sleep 6
  accept
  page /image image.jpg || fail "the page has no picture"
  for part in '"tracks":[1-9]' '"turned_rad":\[[0-9.]*[1-9]' '"peak_hz":[1-9]' '"grade":"ok"'; do
    grep -q "$part" "$out/state.json" || fail "the page lacks $part"
  done
  found=0
  wait $checker || found=$?
  [ $found -le 1 ] || fail "epiline check ended with $found"
  stop_playing
  cat "$out/check.txt"
  # with what was accepted, a right rig before a board is right
  play "$1" "$2" "$3"
  user check --config "$out/epiline.toml" $sets --seconds 10 | tee "$out/check.txt"
  stop_playing
  for part in 'time offset' 'rotation between them'; do
    grep -q "^ok  *camera and imu: $part" "$out/check.txt" || fail "check says nothing good of the $part"
  done
  play "$1" "$2" "$3"
  rm -rf "$out/live"
  user calibrate --config "$out/epiline.toml" $sets --board "$1/board.yaml" --duration "$3" --out "$out/live"
  stop_playing
  grep -q "$out/live/camera.yaml" "$out/epiline.toml" || fail "the calibration is not in the configuration"
  ! grep '^time_offset_s' "$out/epiline.toml" || fail "the accepted time offset would override the calibration"
}

fly() {
  play "$1" "$1/mav0/cam0/sensor.yaml" "$2"
  user check --config "$out/epiline.toml" $sets --seconds 6
  stop_playing
  play "$1" "$1/mav0/cam0/sensor.yaml" "$2"
  echo "\$ epiline run --config $out/epiline.toml"
  "$program" run --config "$out/epiline.toml" $sets --out "$out/run" >"$out/run.txt" 2>"$out/run.err" &
  runner=$!
  while kill -0 $player 2>/dev/null; do
    kill -0 $runner 2>/dev/null || fail "epiline run ended"
    sleep 0.2
  done
  accepted=0
  wait $player || accepted=$?
  kill $runner
  wait $runner || true
  grep -hE '^(PX4|ArduPilot|played|received|flight|latency|error|images|readings|output)' "$out/player.txt" "$out/run.txt"
  [ $accepted -eq 0 ] || fail "the controller's model did not accept it"
  user evaluate "$out/run/trajectory.tum" "$out/player/truth.tum" | tee "$out/evaluate.txt"
  awk '$1 == "ATE" && $3 < 0.05 { near = 1 } END { exit !near }' "$out/evaluate.txt" || fail "the path is off by 5 cm or more"
}

"$phase" "$@"
