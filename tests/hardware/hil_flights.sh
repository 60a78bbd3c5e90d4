#!/bin/sh
# usage: hil_flights.sh PROGRAM FLIGHT SECONDS [NAME...]. In the machine of tests/hardware/vm: a recorded flight through the
# kernel's camera and IMU interfaces into `epiline hil`, and out to the controller model. Each flight must be accepted, and its
# path be that of the truth to 5 cm.
set -u
program=$1 flight=$2 seconds=$3
shift 3
[ $# -gt 0 ] || set -- pty vcan classic mavlink
out=/out
ip link add vcan0 type vcan && ip link set vcan0 mtu 72 up
failed=0
for name in "$@"; do
  cat >"$out/$name.toml" <<TOML
[camera]
calibration = "$flight/mav0/cam0/sensor.yaml"
[imu]
calibration = "$flight/mav0/imu0/sensor.yaml"
rate_hz = 200
[can]
fd = $([ "$name" = classic ] && echo false || echo true)
TOML
  camera=v4l2loopback:/dev/video42 imu=uhid controller=pty
  case $name in
    vcan | classic) controller=vcan0 ;;
    mavlink) imu=mavlink ;;
  esac
  status=0
  "$program" hil "$flight" --config "$out/$name.toml" --camera "$camera" --imu "$imu" --controller "$controller" \
    --duration "$seconds" --out "$out/$name" >"$out/$name.txt" 2>"$out/$name.err" || status=$?
  error=$(awk '/^error / { print $2 }' "$out/$name.txt")
  verdict=$(awk -v s="$status" -v e="${error:-none}" 'BEGIN { print s == 0 && e != "none" && e + 0 < 0.05 ? "ok" : "FAIL" }')
  [ "$verdict" = ok ] || failed=1
  echo "== $verdict: $camera, $imu, $controller ($name)"
  if [ "$verdict" = ok ]; then grep -E '^(images|readings|output|latency|error)' "$out/$name.txt"; else
    grep -v '^kept' "$out/$name.txt"
    tail -n 1 "$out/$name.err"
  fi
done
exit $failed
