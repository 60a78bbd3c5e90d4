#!/bin/sh
# usage: hil_flights.sh PROGRAM FLIGHT RIG SECONDS [NAME...]. In the machine of tests/hardware/vm: a recorded flight through the
# kernel's camera and IMU interfaces into `epiline run`, a process of its own with an ordinary configuration file, and out to
# the controller model of `epiline hil --beside`. Each flight must be accepted, and both its path and what the controller got
# of it be the truth to 5 cm. `alone`: all of it in one process. `check`: `epiline check` instead of the flight. `rig`,
# `rig_alone`: the flight RIG, whose three cameras nothing triggers together, each through a device of its own.
set -u
program=$1 flight=$2 rig=$3 seconds=$4
shift 4
[ $# -gt 0 ] || set -- pty vcan classic mavlink alone check
out=/out
one=v4l2loopback:/dev/video42 three=v4l2loopback:/dev/video42,/dev/video43,/dev/video44
line=/run/controller
ip link add vcan0 type vcan && ip link set vcan0 mtu 72 up

# configuration NAME: as somebody with these devices writes it.
configuration() {
  where=$flight
  case $1 in
    rig*)
      where=$rig
      printf '[second_camera]\ndevice = "/dev/video43"\nfree_running = true\ncalibration = "%s"\n' "$rig/mav0/cam1/sensor.yaml"
      printf '[third_camera]\ndevice = "/dev/video44"\nfree_running = true\ncalibration = "%s"\n' "$rig/mav0/cam2/sensor.yaml"
      ;;
  esac
  cat <<TOML
[camera]
device = "/dev/video42"
rate_hz = 20
trust_stamps = true
stamp_point = "start-of-exposure"
calibration = "$where/mav0/cam0/sensor.yaml"
[imu]
calibration = "$where/mav0/imu0/sensor.yaml"
rate_hz = 200
TOML
  case $1 in
    mavlink) printf 'driver = "mavlink"\n' ;;
    *) printf 'driver = "iio"\ndevice = "gyro_3d"\ndevice_accel = "accel_3d"\n' ;;
  esac
  case $1 in
    vcan) printf '[can]\ninterface = "vcan0"\n' ;;
    classic) printf '[can]\ninterface = "vcan0"\nfd = false\n' ;;
    *) printf '[mavlink]\nserial = "%s"\n' "$line" ;;
  esac
}

# beside FOLDER OPTIONS... : plays what the other process is to see; returns when it may be started.
beside() {
  folder=$1
  shift
  "$program" hil "$where" --config "$folder.toml" --beside --camera "$camera" --duration "$seconds" --out "$folder" "$@" \
    >"$folder.txt" 2>"$folder.err" &
  player=$!
  while ! grep -q '^ready' "$folder.txt" && kill -0 $player 2>/dev/null; do sleep 0.1; done
}

# fly NAME: true if it is accepted.
fly() {
  folder=$out/$1
  imu=uhid controller=pty:$line
  case $1 in
    vcan | classic) controller=vcan0 ;;
    mavlink) imu=mavlink ;;
  esac
  camera=$one
  case $1 in rig*) camera=$three ;; esac
  if [ "${1%alone}" != "$1" ]; then
    "$program" hil "$where" --config "$folder.toml" --camera "$camera" --imu "$imu" --controller "$controller" \
      --duration "$seconds" --out "$folder" >"$folder.txt" 2>"$folder.err"
    return
  fi
  beside "$folder" --imu "$imu" --controller "$controller"
  "$program" run --config "$folder.toml" --out "$folder/run" >"$folder.run.txt" 2>"$folder.run.err" &
  runner=$!
  # who judges waits for ever for somebody who flies
  while kill -0 $player 2>/dev/null; do
    kill -0 $runner 2>/dev/null || kill $player
    sleep 0.2
  done
  judged=0 flown=0
  wait $player || judged=$?
  kill $runner 2>/dev/null
  wait $runner || flown=$?
  "$program" evaluate "$folder/run/trajectory.tum" "$folder/truth.tum" >"$folder.evaluate.txt" 2>&1
  awk '$1 == "ATE" { print "error     " $3 " m rms (4-DoF alignment)" }' "$folder.evaluate.txt" >>"$folder.run.txt"
  [ $judged -eq 0 ] && [ $flown -eq 0 ]
}

# says FILE: whether a line of it matches each pattern of the standard input; names those that are missing.
says() {
  missing=0
  while read -r pattern; do
    grep -qE "$pattern" "$1" && continue
    echo "not found: $pattern" >&2
    missing=1
  done
  return $missing
}

# look FOLDER: `epiline check` at what is played, and at what is left when the player has gone.
look() {
  folder=$1 camera=$one
  beside "$folder" --imu uhid --controller "pty:$line"
  there=0 gone=0
  "$program" check --config "$folder.toml" --seconds 6 >"$folder.run.txt" 2>"$folder.run.err" || there=$?
  kill $player
  wait $player
  "$program" check --config "$folder.toml" --seconds 1 >"$folder.gone.txt" 2>"$folder.gone.err" || gone=$?
  echo "exit      $there with devices, $gone without" >>"$folder.gone.txt"
  [ $there -eq 0 ] && [ $gone -eq 1 ] || return
  says "$folder.run.txt" <<'LINES' 2>"$folder.err" && says "$folder.gone.txt" <<'GONE' 2>>"$folder.err"
^ok +camera: /dev/video42 is present
^ok +camera: (19.9|20.0). images per second
^ok +camera: mean brightness
^ok +camera: [0-9]+ of [0-9]+ corners found
^warning +camera: the exposure time is unknown
^ok +imu: gyro_3d is present
^ok +imu: accel_3d is present
^ok +imu: (199.9|200.[01]) samples per second
^ok +camera and imu: time offset
^ok +camera and imu: rotation between them
^ok +mavlink: /run/controller is present
^ok +mavlink: [0-9]+ packets received
^(ok|warning) +mavlink: clock: skew [-+0-9.]+ ppm, residual 0[.][0-9]+ ms
LINES
^error +camera:
^error +imu: no device is called "gyro_3d"
^error +imu: no device is called "accel_3d"
^error +mavlink: /run/controller does not exist
GONE
}

# is_near FILES...: whether the errors said in them are there, and below 5 cm.
is_near() {
  awk '/^error / { e = $2; n++ } /^received / && / m rms / { e = $4; n++ } e + 0 >= 0.05 { far = 1 }
    END { exit far || n != 2 }' "$@"
}

failed=0
for name in "$@"; do
  folder=$out/$name
  case $name in
    rig*) modprobe -r v4l2loopback && modprobe v4l2loopback video_nr=42,43,44 ;;
  esac
  configuration "$name" >"$folder.toml"
  rm -f "$folder".*txt "$folder".*err
  : >"$folder.run.txt"
  if [ "$name" = check ]; then
    if look "$folder"; then
      echo "== ok: $name"
      grep -hE '^(ok|warning|exit)' "$folder.run.txt" "$folder.gone.txt"
    else
      failed=1
      echo "== FAIL: $name"
      cat "$folder".*err "$folder.run.txt" "$folder.gone.txt"
    fi
    continue
  fi
  if fly "$name" && is_near "$folder.txt" "$folder.run.txt"; then
    echo "== ok: $name"
    grep -hE '^(PX4|ArduPilot|played|received|flight|latency|error|images|readings|output)' "$folder.txt" "$folder.run.txt"
  else
    failed=1
    echo "== FAIL: $name"
    grep -hv '^kept' "$folder.txt" "$folder.run.txt"
    tail -qn 3 "$folder".*err
  fi
done
exit $failed
