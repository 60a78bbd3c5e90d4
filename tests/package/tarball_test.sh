#!/usr/bin/env bash
# usage: tarball_test.sh TARBALL PROGRAM SUITE, beside PROGRAM lies PROGRAM-study. Unpacks the tarball on a clean Debian SUITE, on which nothing is installed, moves the
# folder, and flies a rendered flight there: the trajectory must be PROGRAM's, which is the one of this build. Root only.
set -euo pipefail
tarball=$(realpath "$1") program=$(realpath "$2") suite=$3 arch=$(dpkg --print-architecture) package=
. "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/debian/clean_debian"
fail() { printf 'FAIL  %s: %s\n' "$suite" "$1"; exit 1; }

tar -xzf "$tarball" -C "$root/opt"
mv "$root"/opt/epiline-* "$root/srv/flies here"
"$program-study" simulate --flight hover --duration 4 --out "$root/tmp/flight" --quiet
inside "/srv/flies here/bin/epiline" replay /tmp/flight --out /tmp/out --quiet >"$work/log" 2>&1 || { cat "$work/log"; fail "no flight"; }
"$program" replay "$root/tmp/flight" --out "$work/out" --quiet
cmp "$work/out/trajectory.tum" "$root/tmp/out/trajectory.tum" || fail "another trajectory than that of this build"
missing=$(inside env "LD_TRACE_LOADED_OBJECTS=1" "/srv/flies here/bin/epiline" | grep 'not found' || true)
[[ -z $missing ]] || fail "$missing"
printf 'ok    %s, glibc %s: the same trajectory\n' "$suite" "$(inside ldd --version | sed 's/.* //;q')"
