#!/usr/bin/env bash
# usage: install_test.sh PACKAGE.deb SUITE STUDY. Installs the package on a clean Debian SUITE (bookworm is Debian 12, trixie 13) and
# tries what it brings: dependencies, program, user and groups, service, removal. Root only. A package for arm64 is tried under qemu.
set -euo pipefail
(($# == 3)) || { echo "usage: $0 PACKAGE.deb SUITE STUDY" >&2; exit 2; }
package=$(realpath "$1") suite=$2 study=$(realpath "$3")
. "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/debian/clean_debian"
. "$(dirname "${BASH_SOURCE[0]}")/steps"

# The service's rights: its user and groups, no capability, nothing to be gained; its limits, where we may raise them.
limits=(prlimit --rtprio=90 --memlock=unlimited)
"${limits[@]}" true 2>/dev/null || { limits=() && echo "      no right to raise limits here: without priorities and locked memory"; }
as_service() {
  inside "${limits[@]}" setpriv --reuid epiline --regid epiline --init-groups --bounding-set=-all \
    --inh-caps=-all --no-new-privs "$@"
}
# What the program can do without, and users of a package can't: it was there when the program was built.
depends_on_all() {
  local library
  for library in libapriltag libgpiod libmicrohttpd libnettle; do
    dpkg-deb -f "$package" Depends | grep -q "$library" || { echo "built without $library"; return 1; }
  done
  dpkg-deb -f "$package" Suggests | grep -q libddsc || { echo "built without Cyclone DDS"; return 1; }
}
try_examples() {
  local file
  for file in "$root"/usr/share/doc/epiline/examples/*.toml; do
    inside epiline config --check "${file#"$root"}" >/dev/null || return
  done
}

# under qemu an image takes seconds
flight=(--duration 4) speed=2
if [[ -n $emulated ]]; then flight=(--duration 2.4 --rate 5) speed=0.05; fi

ok "nothing was left out" depends_on_all
inside apt-get update -qq
ok "dependencies can be had" inside apt-get satisfy -y -qq --no-install-recommends "$(dpkg-deb -f "$package" Depends)"
ok "dpkg -i" inside dpkg -i /epiline.deb
ok "program runs" exits 0 "^[0-9]+\.[0-9]+\.[0-9]+$" inside epiline --version
ok "examples are configurations" try_examples
ok "user without login" exits 0 ":/usr/sbin/nologin$" inside getent passwd epiline
ok "groups" inside getent group epiline gpio spi
ok "manual and completion are there" inside test -s /usr/share/man/man1/epiline.1.gz -a -s /usr/share/bash-completion/completions/epiline
ok "a flight is made up" "$study" simulate --flight hall "${flight[@]}" --effects none --out "$root/tmp/flight" --quiet
ok "as the service's user, it is flown in threads" as_service epiline replay /tmp/flight --realtime --speed $speed --out /tmp/out --quiet
if inside epiline --help | grep -q '^  check '; then
  example=/usr/share/doc/epiline/examples/raspberry-pi-5.toml
  ok "check names the missing camera" exits 1 "[Cc]amera" as_service epiline check --config $example
  ok "check names the missing IMU" exits 1 "IMU|spidev" as_service epiline check --config $example
fi
ok "run without a configuration says so, at once" exits 2 "epiline: error: " as_service epiline run --config /etc/epiline/none.toml

ok "systemd" inside apt-get install -y -qq --no-install-recommends systemd udev
ok "unit is clean" exits 0 '^$' inside systemd-analyze verify --man=no /lib/systemd/system/epiline.service
printf '      %s\n' "$(inside systemd-analyze security --offline=true epiline.service 2>&1 | grep -i 'overall exposure')"

ok "removed" inside dpkg -r epiline
touch "$root/etc/epiline/epiline.toml"
ok "purged" inside dpkg -P epiline
ok "the user's configuration stays" test -f "$root/etc/epiline/epiline.toml"
# /tmp holds what this test has made
ok "nothing else stays" exits 0 "^$" sh -c "cd '$root' && find . -xdev -path ./epiline.deb -prune -o -path ./etc/epiline -prune -o -path ./tmp -prune -o -name '*epiline*' -print"
exit "$failed"
