#!/usr/bin/env bash
# usage: consumer_test.sh BUILD ROOT. Installs the libraries from BUILD into a folder of its own, and builds and runs programs
# against them, as somebody else would: find_package(epiline), pkg-config, import epiline; nothing of our tree. The examples of the
# documents fly the flight that the command flies, and come to the same trajectory, bit by bit.
set -euo pipefail
build=$1 root=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
quietly() { "$@" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }; }
quietly cmake --build "$build" --target packaged
for component in development library python; do
  quietly cmake --install "$build" --component $component --prefix "$work/installed"
done
quietly cmake -G Ninja -S "$root/tests/package/consumer" -B "$work/build" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_PREFIX_PATH="$work/installed"
quietly cmake --build "$work/build"
"$work/build/consumer"
# the examples of the documents, from the same files
quietly cmake -G Ninja -S "$root/docs/examples/library" -B "$work/example" -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$work/installed"
quietly cmake --build "$work/example"
for example in odometry images; do
  "$work/example/${example}_example" >"$work/log" || { cat "$work/log"; exit 1; }
  [[ $(grep -c ' tracking$' "$work/log") -ge 9 ]] || { cat "$work/log"; exit 1; }
done
# same FILE...: as the command's trajectory
same() {
  [[ $(wc -l <"$work/out/trajectory.tum") -ge 30 ]] || { echo "the command flew less than 30 poses"; exit 1; }
  for file; do cmp "$work/out/trajectory.tum" "$file"; done
}
epiline=$build/bin/epiline
quietly "$epiline-study" simulate --flight agile --duration 4 --tracks --out "$work/tracks"
quietly "$epiline" replay "$work/tracks" --out "$work/out" --quiet
"$work/example/tracks_example" "$work/tracks" >"$work/pushed.tum"
same "$work/pushed.tum"
rm -rf "$work/out"
quietly "$epiline-study" simulate --flight agile --duration 4 --out "$work/flight"
quietly "$epiline" replay "$work/flight" --out "$work/out" --quiet --set tracker.max_features=200
export PYTHONPATH=$work/installed/lib/python3/dist-packages PYTHONDONTWRITEBYTECODE=1
cd "$work"
quietly /usr/bin/python3 "$root/docs/examples/library/odometry.py" "$work/flight"
same replayed.tum pushed.tum
quietly /usr/bin/python3 "$root/tests/package/python_test.py" "$work/flight" "$work/tracks" "$work/out"
grep -rlF "$root" "$work/installed" && { echo "what is installed names this source tree"; exit 1; }
exit 0
