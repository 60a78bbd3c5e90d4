#!/usr/bin/env bash
# usage: upgrade_test.sh OLD NEW STUDY. Installs the packages for Debian 12 in the folder OLD on a clean Debian 12, and upgrades it to
# Debian 13 with those in the folder NEW: apt must leave the old ones until then, and take the new ones with it. Root only.
set -euo pipefail
(($# == 3)) || { echo "usage: $0 OLD NEW STUDY" >&2; exit 2; }
old=$(realpath "$1") new=$(realpath "$2") study=$(realpath "$3") suite=bookworm package='' arch=$(dpkg --print-architecture)
. "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/debian/clean_debian"
. "$(dirname "${BASH_SOURCE[0]}")/steps"

packages=(epiline libepiline1 libepiline-dev python3-epiline)
# copied FROM TO: our packages, and the list of them that makes the folder a source of apt's.
copied() {
  mkdir "$root/$2"
  for name in "${packages[@]}"; do cp "$1/${name}"_*_"$arch.deb" "$root/$2/"; done
  (cd "$root/$2" && dpkg-scanpackages . >Packages 2>/dev/null)
  echo "deb [trusted=yes] file:/$2 ./" >>"$root/etc/apt/sources.list"
  inside apt-get update -qq
}
# are_of RELEASE: all packages are complete, and those of that release.
are_of() {
  local name
  for name in "${packages[@]}"; do
    exits 0 "^install ok installed .*[+]deb$1u" inside dpkg-query -W -f='${Status} ${Version}\n' "$name" || return
  done
  exits 0 '^$' inside dpkg -V "${packages[@]}"
}
# flown FOLDER: the same flight, by the program and from Python.
flown() {
  inside epiline replay /tmp/flight --out "/tmp/$1" --quiet &&
    exits 0 '^[0-9]+ poses' inside python3 -B -c "import epiline; print(len(epiline.replay('/tmp/flight').trajectory), 'poses')"
}

copied "$old" old
ok "Debian 12: installed" inside apt-get install -y -qq --no-install-recommends "${packages[@]}"
ok "all of Debian 12" are_of 12
echo 'kept = 1' >"$root/etc/epiline/epiline.toml"
ok "a flight is made up" "$study" simulate --flight agile --duration 4 --out "$root/tmp/flight" --quiet
ok "and flown" flown first
owner=$(inside id epiline)

copied "$new" new
ok "those for Debian 13 are refused there" exits 100 "broken packages" inside apt-get install -y -qq "${packages[@]}"
ok "and an upgrade leaves the old ones" inside apt-get upgrade -y -qq
ok "all of Debian 12 still" are_of 12

sed -i 's/bookworm/trixie/g' "$root/etc/apt/sources.list"
inside apt-get update -qq
ok "upgraded to Debian 13" inside apt-get dist-upgrade -y -qq
ok "all of Debian 13" are_of 13
ok "flown again" flown second
ok "nearly the same trajectory" inside epiline evaluate /tmp/second/trajectory.tum /tmp/first/trajectory.tum
ok "the user and the configuration stay" test "$(inside id epiline)" == "$owner" -a -s "$root/etc/epiline/epiline.toml"
ok "removed" inside dpkg -r "${packages[@]}"
ok "purged" inside dpkg -P "${packages[@]}"
exit "$failed"
