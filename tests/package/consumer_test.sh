#!/usr/bin/env bash
# usage: consumer_test.sh BUILD ROOT. Installs the library from BUILD into a folder of its own, and builds and runs a small program
# against it, as somebody else would: find_package(epiline), nothing of our tree.
set -euo pipefail
build=$1 root=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
quietly() { "$@" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }; }
quietly cmake --build "$build" --target packaged
quietly cmake --install "$build" --component development --prefix "$work/installed"
quietly cmake -G Ninja -S "$root/tests/package/consumer" -B "$work/build" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_PREFIX_PATH="$work/installed"
quietly cmake --build "$work/build"
"$work/build/consumer"
# the example of the documents, from the same file
quietly cmake -G Ninja -S "$root/docs/examples/library" -B "$work/example" -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$work/installed"
quietly cmake --build "$work/example"
"$work/example/odometry_example" >"$work/log" || { cat "$work/log"; exit 1; }
[[ $(grep -c ' tracking$' "$work/log") == 10 ]] || { cat "$work/log"; exit 1; }
grep -rlF "$root" "$work/installed" && { echo "what is installed names this source tree"; exit 1; }
exit 0
