#!/usr/bin/env bash
# usage: manual_test.sh PROGRAM ROOT. The manual page names every command, every option of it and every setting, and is sound roff
# as far as the tools that are installed can tell.
set -uo pipefail
program=$1 root=$2 failed=0
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$root/toolchains/debian/make_manual" "$root/toolchains/debian/epiline.1.in" "$work/epiline.1.gz" "$program" || exit 1
zcat "$work/epiline.1.gz" >"$work/epiline.1"
text=$(sed 's/\\-/-/g; s/\\e/\\/g' "$work/epiline.1")

mapfile -t commands < <("$program" --help | grep -oP '^  \K[a-z]+')
((${#commands[@]} >= 6)) || { echo "only ${#commands[@]} commands in --help"; failed=1; }
for command in "${commands[@]}"; do
  section=$(sed -n "/^\.SS epiline $command\$/,/^\.S[SH] /p" <<<"$text")
  for option in $("$program" "$command" --help | grep -oP '^  (-\w,)?\K--[a-z-]+' | grep -v '^--help$'); do
    [[ $section == *"$option"* ]] || { echo "epiline $command: no $option in the manual page"; failed=1; }
  done
  [[ -n $section ]] || { echo "no command $command in the manual page"; failed=1; }
done
for key in $("$program" config | grep -oP '^#?\K[a-z_0-9]+(?= = )'); do
  [[ $text == *$'\n'".B $key = "* ]] || { echo "no setting $key in the manual page"; failed=1; }
done
grep -n '@[A-Z]*@' "$work/epiline.1" && failed=1
if command -v groff >/dev/null; then
  groff -man -Tutf8 -ww -rLL=100n "$work/epiline.1" 2>&1 >/dev/null | grep -v 'cannot adjust line\|can.t break line' && failed=1
fi
exit "$failed"
