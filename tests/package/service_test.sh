#!/usr/bin/env bash
# usage: service_test.sh PACKAGE.deb RESTING_IMU. Boots a clean Debian 12 with systemd and the package in the machine of
# tests/hardware/vm, and looks at the service with the kernel's own devices: vivid as camera, a HID sensor hub as IMU (which
# RESTING_IMU plays), a serial gadget as flight controller, gpio-sim. Root only. EPILINE_VM_LIMIT: seconds for it all (default 1500).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

# In the machine, which sees the other one's files: systemd is the first process of name spaces of its own, with $root as root.
if [[ ${1:-} == --inside ]]; then
  root=$2
  mount --bind "$root" "$root" # name spaces of services need a mount for root
  for folder in dev sys out "lib/modules/$(uname -r)"; do
    mkdir -p "$root/$folder"
    mount --rbind "/$folder" "$root/$folder"
  done
  mount -t tmpfs -o mode=755 run "$root/run"
  "$3" & # the IMU
  unshare --fork --pid --mount sh -c 'cd "$1" && mount -t proc proc proc && exec chroot . /lib/systemd/systemd --system \
    --unit=probe.target --show-status=false' sh "$root" >/out/systemd.log 2>&1 </dev/null || true
  exit "$(cat /out/probe.status)"
fi

(($# == 2)) || { echo "usage: $0 PACKAGE.deb RESTING_IMU" >&2; exit 2; }
package=$(realpath "$1") resting_imu=$(realpath "$2") suite=bookworm
. "$here/../../toolchains/debian/clean_debian"
inside apt-get update -qq
inside apt-get satisfy -y -qq --no-install-recommends "$(dpkg-deb -f "$package" Depends), systemd, systemd-sysv, udev, dbus, kmod, procps" \
  >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
inside dpkg -i /epiline.deb >/dev/null
umount -R "$root/dev" "$root/proc"
install -m 755 "$here/service_probe.sh" "$root/probe"
cat >"$root/etc/systemd/system/probe.service" <<'UNIT'
[Service]
Type=oneshot
ExecStart=/bin/sh -c '/probe >/out/probe.log 2>&1; echo $? >/out/probe.status'
# at once: in order, it would cut the machine off from the files it was given
ExecStopPost=-/usr/bin/systemctl --force --force poweroff
UNIT
printf '[Unit]\nRequires=basic.target probe.service\nAfter=basic.target\nAllowIsolate=yes\n' >"$root/etc/systemd/system/probe.target"
out=$work/out status=0
# The machine's clock counts instructions (-i): times of the unit hold, however busy this computer is.
"$here/../hardware/vm/run_in_vm" -i -t "${EPILINE_VM_LIMIT:-1500}" -o "$out" \
  -m vivid,n_devs=1,node_types=0x1,num_inputs=1,input_types=0x0 -m uhid -m hid-sensor-gyro-3d -m hid-sensor-accel-3d \
  -m gpio-sim -m dummy_hcd -m usb_f_acm \
  bash "$here/service_test.sh" --inside "$root" "$resting_imu" || status=$?
cat "$out/probe.log" || tail -n 40 "$out/systemd.log" || true
exit "$status"
