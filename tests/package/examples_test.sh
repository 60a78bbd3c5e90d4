#!/usr/bin/env bash
# usage: examples_test.sh PROGRAM FOLDER. Every example configuration in FOLDER is one the program takes: known names, values within
# their ranges; one with an unknown name is refused.
set -uo pipefail
program=$1 failed=0 count=0
for file in "$2"/*.toml; do
  count=$((count + 1))
  output=$("$program" config --check "$file" 2>&1 >/dev/null) || { echo "$file: $output"; failed=1; }
done
((count >= 3)) || { echo "$2: $count examples; expected at least 3"; failed=1; }
wrong=$(mktemp)
trap 'rm -f "$wrong"' EXIT
cat "$2/rover-can.toml" - >"$wrong" <<<'weight_kg = 12'
"$program" config --check "$wrong" >/dev/null 2>&1 && { echo "an unknown name is taken"; failed=1; }
exit "$failed"
