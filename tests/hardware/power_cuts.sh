#!/bin/sh
# usage: power_cuts.sh PROGRAM COMMAND FLIGHT. In the machine of tests/hardware/vm: COMMAND writes to a new file system on the machine's
# disk until the machine is killed. The guest's time goes to stdout ten times a second, with "writing" from the command's first file on.
set -eu
program=$1 command=$2 flight=$3 disk=/run/disk line=/run/controller
modprobe virtio_blk
modprobe ext4
mkdir -p "$disk"
mkfs.ext4 -q -F /dev/vda
mount -t ext4 /dev/vda "$disk"
cat >"$disk/epiline.toml" <<TOML
[camera]
device = "/dev/video42"
rate_hz = 20
trust_stamps = true
stamp_point = "start-of-exposure"
calibration = "$flight/mav0/cam0/sensor.yaml"
[imu]
driver = "iio"
device = "gyro_3d"
device_accel = "accel_3d"
rate_hz = 200
calibration = "$flight/mav0/imu0/sensor.yaml"
[mavlink]
serial = "$line"
TOML
cp "$disk/epiline.toml" /run/player.toml
sync
# the machine's clock goes on while it waits for the host's disk
cat "$program" $(ldd "$program" | awk '/=> \// { print $3 }') >/dev/null

"$program" hil "$flight" --config /run/player.toml --beside --camera v4l2loopback:/dev/video42 --imu uhid \
  --controller "pty:$line" --out /run/player >/run/player.txt 2>/run/player.err &
while ! grep -q '^ready' /run/player.txt; do kill -0 $! || { cat /run/player.err; exit 1; }; sleep 0.1; done
case $command in
  run) "$program" run --config "$disk/epiline.toml" --out "$disk/out" --record "$disk/records" >/run/user.txt 2>&1 & ;;
  record) "$program" record --config "$disk/epiline.toml" --out "$disk/out" --keep-free 1 >/run/user.txt 2>&1 & ;;
esac
user=$!
while kill -0 $user 2>/dev/null; do
  read -r now rest </proc/uptime
  first=$(find "$disk/out" -name '*.tum' -o -name '*.png' 2>/dev/null | head -n 1)
  echo "now $now ${first:+writing}"
  sleep 0.1
done
cat /run/user.txt
