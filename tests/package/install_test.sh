#!/usr/bin/env bash
# usage: install_test.sh PACKAGE.deb. Installs the package on a clean Debian 12 of this machine's architecture and tries what it
# brings: dependencies, program, user and groups, service, removal. Root only, since it makes a Debian (debootstrap) and goes into
# it; the Debian is kept in $EPILINE_ROOT_CACHE (default ~/.cache/epiline), each run gets a fresh layer above it.
set -euo pipefail
(($# == 1)) || { echo "usage: $0 PACKAGE.deb" >&2; exit 2; }
package=$(realpath "$1")
cache=${EPILINE_ROOT_CACHE:-${HOME:-/root}/.cache/epiline}
# where this machine gets its own packages from
mirror=${EPILINE_DEBIAN_MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Codename: bookworm' | sort -u | head -1)}
[[ -n $mirror ]] || { echo "$0: apt knows no bookworm; expected Debian 12, or EPILINE_DEBIAN_MIRROR" >&2; exit 2; }

if [[ -z ${EPILINE_IN_NAMESPACE:-} ]]; then # mounts of our own, which vanish with us
  EPILINE_IN_NAMESPACE=1 exec unshare --mount "$0" "$package"
fi

base=$cache/debian-12
if [[ ! -d $base ]]; then
  rm -rf "$base.half"
  debootstrap --variant=minbase bookworm "$base.half" "$mirror" >"$cache/debootstrap.log" || { cat "$cache/debootstrap.log" >&2; exit 1; }
  rm -f "$base.half"/var/cache/apt/archives/*.deb
  mv "$base.half" "$base"
fi

work=$(mktemp -d -p "$cache")
trap 'umount -R "$work/root" 2>/dev/null || true; rm -rf "$work"' EXIT
mkdir -p "$work"/{upper,work,root} "$cache/archives/partial"
mount -t overlay overlay -o "lowerdir=$base,upperdir=$work/upper,workdir=$work/work" "$work/root"
mount -t proc proc "$work/root/proc"
mount -t tmpfs tmpfs "$work/root/dev"
for file in null zero full random urandom tty; do
  touch "$work/root/dev/$file"
  mount --bind "/dev/$file" "$work/root/dev/$file"
done
mkdir -p "$work/root/var/cache/apt/archives"
mount --bind "$cache/archives" "$work/root/var/cache/apt/archives" # what apt has fetched before
cp /etc/resolv.conf "$work/root/etc/resolv.conf"
for file in /etc/hosts /etc/apt/apt.conf.d/*proxy*; do
  if [[ -f $file ]]; then cp "$file" "$work/root$file"; fi
done
cp "$package" "$work/root/epiline.deb"

failed=0
inside() { chroot "$work/root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C DEBIAN_FRONTEND=noninteractive "$@" </dev/null; }
# ok WHAT COMMAND...: one line each; output only of what fails.
ok() {
  local what=$1
  shift
  if "$@" >"$work/log" 2>&1; then
    printf 'ok    %s\n' "$what"
  else
    printf 'FAIL  %s (exit code %d)\n' "$what" $?
    sed 's/^/      /' "$work/log" | tail -20
    failed=1
  fi
}
# exits CODE TEXT COMMAND...: the command ends with this code and says this text (an extended regular expression).
exits() {
  local code=$1 text=$2 status=0 output
  shift 2
  output=$("$@" 2>&1) || status=$?
  printf '%s\n' "$output"
  [[ $status == "$code" ]] && grep -qE "$text" <<<"$output"
}
# The service's rights: its user and groups, no capability, nothing to be gained; its limits, where we may raise them.
limits=(prlimit --rtprio=90 --memlock=unlimited)
"${limits[@]}" true 2>/dev/null || { limits=() && echo "      no right to raise limits here: without priorities and locked memory"; }
as_service() {
  inside "${limits[@]}" setpriv --reuid epiline --regid epiline --init-groups --bounding-set=-all \
    --inh-caps=-all --no-new-privs "$@"
}
try_examples() {
  local file
  for file in "$work/root"/usr/share/doc/epiline/examples/*.toml; do
    inside epiline config --check "${file#"$work/root"}" >/dev/null || return
  done
}

inside apt-get update -qq
ok "dependencies can be had" inside apt-get satisfy -y -qq --no-install-recommends "$(dpkg-deb -f "$package" Depends)"
ok "dpkg -i" inside dpkg -i /epiline.deb
ok "program runs" exits 0 "^[0-9]+\.[0-9]+\.[0-9]+$" inside epiline --version
ok "examples are configurations" try_examples
ok "user without login" exits 0 ":/usr/sbin/nologin$" inside getent passwd epiline
ok "groups" inside getent group epiline gpio spi
ok "manual and completion are there" inside test -s /usr/share/man/man1/epiline.1.gz -a -s /usr/share/bash-completion/completions/epiline
ok "as the service's user, a flight is made up" as_service epiline simulate --flight hall --duration 4 --effects none --out /tmp/flight
ok "and flown in threads" as_service epiline replay /tmp/flight --realtime --speed 2 --out /tmp/out --quiet
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
touch "$work/root/etc/epiline/epiline.toml"
ok "purged" inside dpkg -P epiline
ok "the user's configuration stays" test -f "$work/root/etc/epiline/epiline.toml"
ok "nothing else stays" exits 0 "^$" sh -c "cd '$work/root' && find . -xdev -path ./epiline.deb -prune -o -path ./etc/epiline -prune -o -name '*epiline*' -print"
exit "$failed"
