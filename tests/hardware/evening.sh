#!/bin/sh
# usage: evening.sh PROGRAM record BOARD CAMERA SECONDS | evening.sh PROGRAM fly FLIGHT SECONDS. In the machine of
# tests/hardware/vm: what a user does in an evening, with no file written by hand. `record`: devices, init and record, before a
# waved board (BOARD, made by the study `calibrations --write`, CAMERA the calibration it was made with). `epiline calibrate
# --config` comes between the two, outside, where a processor has its full speed. `fly`: check, and a flight through the
# kernel's interfaces, accepted by the controller's model and true to 5 cm.
set -eu
program=$1 phase=$2
shift 2
out=/out
line=/run/controller
# v4l2loopback does not declare its clock, and the controller is at the end of a pseudo terminal
sets="--set camera.trust_stamps=true --set camera.stamp_point=start-of-exposure --set mavlink.serial=$line"
player=

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
  user record --config "$out/epiline.toml" $sets --out "$out/board" --duration "$(($3 + 1))"
  stop_playing
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
