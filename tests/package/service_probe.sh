#!/bin/bash
# Runs in the machine of service_test.sh, as root beside the service.
set -u
failed=0
ok() {
  local what=$1
  shift
  if "$@" >/tmp/log 2>&1; then echo "ok    $what"; else
    echo "FAIL  $what"
    sed 's/^/      /' /tmp/log | tail -n 30
    failed=1
  fi
}
# within SECONDS COMMAND...: wait for what must come. If it does not: what the service manager knows.
within() {
  local seconds=$1
  shift
  for ((i = 0; i < 2 * seconds; ++i)); do
    "$@" && return 0
    sleep 0.5
  done
  systemctl --no-pager --full status epiline
  journalctl --no-pager -n 20 -u epiline
  return 1
}
show() { systemctl show -p "$1" --value epiline; }
is() { [[ $(show "$1") == "$2" ]]; }
of_process() { sed -n "s/^$1:[[:space:]]*//p" "/proc/$(show MainPID)/status"; }
# another process than this one, ready
anew() { [[ $(show MainPID) != "$1" && $(show MainPID) != 0 ]] && is ActiveState active; }
fails() { ! "$@"; }
says() { journalctl --no-pager -o cat -u epiline | grep -E "$1"; }
# as_service COMMAND...: as root, but in the service's group of processes and its view of files
as_service() {
  bash -c 'echo $$ >/sys/fs/cgroup/system.slice/epiline.service/cgroup.procs && exec nsenter -t "$0" -m -r -- "$@"' "$(show MainPID)" "$@"
}
flies() { [[ $(show StatusText) != "" && ! $(show StatusText) =~ ": 0 images"|", 0 readings" ]]; }

gadget=/sys/kernel/config/usb_gadget/controller
make_controller() {
  mkdir -p $gadget/functions/acm.0 $gadget/configs/c.1
  echo 0x26ac >$gadget/idVendor # PX4's
  echo 0x0011 >$gadget/idProduct
  ln -s $gadget/functions/acm.0 $gadget/configs/c.1/
}
plug_in() { echo dummy_udc.0 >$gadget/UDC; }
unplug() { echo >$gadget/UDC; }
# the first byte of a MAVLink 2 frame comes out of the controller's end
hears() {
  stty -F /dev/ttyGS0 raw -echo
  timeout 5 head -c 1000 /dev/ttyGS0 | od -An -tx1 | grep -q fd
}

echo "      Linux $(uname -r), $(systemctl --version | head -n 1), up $(cut -d' ' -f1 /proc/uptime) s"
systemctl start epiline 2>/dev/null
ok "without a configuration it is not started, and that is no failure" is ActiveState inactive

mkdir -p /sys/kernel/config/gpio-sim/board/bank && echo 1 >/sys/kernel/config/gpio-sim/board/live
ok "the camera has a name that stays" within 30 test -c /dev/epiline/camera-vivid-000-vid-cap
ok "so have the IMU's two devices" within 30 test -c /dev/epiline/imu-gyro_3d -a -c /dev/epiline/imu-accel_3d
ok "GPIO belongs to its group" within 30 bash -c '[[ $(stat -c %G:%a /dev/gpiochip0) == gpio:660 ]]'

cat >/etc/epiline/camera.yaml <<'YAML'
T_BS: [0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 1]
resolution: [320, 180]
camera_model: pinhole
intrinsics: [200, 200, 160, 90]
distortion_model: none
YAML
cat >/etc/epiline/epiline.toml <<'TOML'
[camera]
calibration = "camera.yaml"
device = "/dev/epiline/camera-vivid-000-vid-cap"
width = 320
height = 180
rate_hz = 15
format = "GREY"
[imu]
driver = "iio"
device = "gyro_3d"
device_accel = "accel_3d"
rate_hz = 100
[mavlink]
serial = "/dev/epiline/controller"
[recorder]
folder = "/var/lib/epiline"
TOML

make_controller
systemctl start --no-block epiline
ok "without the controller it flies, and says what is missing" within 60 bash -c '[[ $(systemctl show -p StatusText,NRestarts --value epiline) == *"mavlink /dev/epiline/controller"* ]]'
plug_in
ok "plugged in, the controller has its name" within 30 test -c /dev/epiline/controller
[[ -c /dev/epiline/controller ]] || udevadm info --attribute-walk /dev/ttyACM0 | head -n 60
ok "and the service says that it is ready" within 60 is ActiveState active
ok "images and readings come" within 60 flies
echo "      status: $(show StatusText)"
ok "the controller hears it" within 30 hears

ok "user" bash -c "[[ '$(of_process Uid | cut -f1)' == '$(id -u epiline)' ]]"
ok "no capability, and none to be had" bash -c "[[ '$(of_process CapEff)$(of_process CapBnd)' =~ ^0+$ && '$(of_process NoNewPrivs)' == 1 ]]"
ok "system calls are filtered" bash -c "[[ '$(of_process Seccomp)' == 2 ]]"
ok "memory is locked" bash -c "[[ '$(of_process VmLck | tr -dc 0-9)' -gt 10000 ]]"
priorities=$(ps -L -o rtprio= -p "$(show MainPID)" | grep -v -- - | sort -n | tr -d ' ' | tr '\n' ' ')
ok "threads have their priorities: $priorities" test "$priorities" = "60 60 65 65 70 80 "
ok "other devices are refused, to root too" bash -c "$(declare -f as_service show fails); as_service head -c0 /dev/null && fails as_service head -c0 /dev/kmsg && fails as_service head -c0 /dev/uhid"
ok "the system cannot be written, nor homes be seen" bash -c "$(declare -f as_service show fails); fails as_service touch /usr/x && fails as_service touch /etc/epiline/x && touch ~root/seen && fails as_service ls ~root/seen"

systemctl kill -s USR1 epiline
ok "asked for a record, it writes one" within 60 bash -c 'compgen -G "/var/lib/epiline/*" >/dev/null'

before=$(show MainPID)
unplug
sleep 3
plug_in
ok "the controller was unplugged: it hears the same process again" within 30 hears
ok "which went on" is MainPID "$before"

kill -STOP "$before"
began=$SECONDS
ok "stopped, it is started anew" within 60 anew "$before"
echo "      after $((SECONDS - began)) s"
ok "by the watchdog" says "Watchdog timeout"
ok "and flies" within 60 flies

before=$(show MainPID)
kill -SEGV "$before"
began=$SECONDS
ok "crashed, it is started anew" within 60 anew "$before"
echo "      after $((SECONDS - began)) s"

before=$(show MainPID)
ok "an upgrade" dpkg -i /epiline.deb
ok "starts it anew" within 60 anew "$before"

ok "stops when asked" systemctl stop epiline
ok "without a failure" is Result success
cp /etc/epiline/epiline.toml /tmp/
echo 'nonsense = 1' >>/etc/epiline/epiline.toml
restarts=$(show NRestarts)
systemctl start epiline 2>/dev/null
sleep 5
ok "a wrong configuration fails, and is not tried again" bash -c "[[ $(show ActiveState),$(show ExecMainStatus),$(show NRestarts) == failed,2,$restarts ]]"
cp /tmp/epiline.toml /etc/epiline/
ok "mended, it starts" systemctl start epiline
ok "enabled" systemctl enable epiline
ok "removed, it stops" dpkg -r epiline
ok "for good" bash -c "[[ ! -e /proc/$(show MainPID)/exe && ! -e /etc/systemd/system/multi-user.target.wants/epiline.service ]]"
echo "      $SECONDS s of the machine's time"
exit "$failed"
