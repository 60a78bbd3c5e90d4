#!/usr/bin/env bash
# usage: fetch_test.sh FETCH. What ./run data does with a server on this machine: a download that is cut goes on where it stopped, wrong
# archives are refused, both publishers' archives are unpacked, and without a network one sentence says what to do.
set -uo pipefail
fetch=$1 failed=0
for program in python3 curl bsdtar; do command -v "$program" >/dev/null || { echo "no $program here"; exit 77; }; done
work=$(mktemp -d)
trap 'kill "$server" 2>/dev/null; rm -rf "$work"' EXIT
server=

# expect LABEL STATUS PATTERN NAME...: what fetch answers.
expect() {
  local label=$1 status=$2 pattern=$3 output
  shift 3
  output=$("$fetch" "$work/list" "$work/data" "$@" 2>&1)
  [[ $? == "$status" && $output =~ $pattern ]] || { printf '%s: expected exit code %s and "%s":\n%s\n' "$label" "$status" "$pattern" "$output"; failed=1; }
}
# check LABEL COMMAND...
check() { "${@:2}" >/dev/null || { echo "$1: does not hold: ${*:2}"; failed=1; }; }

# The archives: EuRoC's hold one for each sequence, TUM-VI's one sequence.
python3 - "$work" <<'PYTHON'
import hashlib, io, os, sys, tarfile, zipfile
os.chdir(sys.argv[1])
os.mkdir("served")
inner = io.BytesIO()
with zipfile.ZipFile(inner, "w") as z:
    z.writestr("mav0/imu0/data.csv", "0123456789" * 20000)
    z.writestr("__MACOSX/mav0/._imu0", "x")
for name in "hall", "damaged":
    with zipfile.ZipFile(f"served/{name}.zip", "w") as z:
        for sequence in "A_easy", "B_easy":
            z.writestr(f"{name}/{sequence}/{sequence}.zip", inner.getvalue())
            z.writestr(f"{name}/{sequence}/{sequence}.bag", "bag")
data = io.BytesIO(b"fisheye")
with tarfile.open("served/dataset-room_512_16.tar", "w") as t:
    for path in "mav0/cam0/data.csv", "dso/camchain.yaml":
        info = tarfile.TarInfo("dataset-room_512_16/" + path)
        info.size = 7
        data.seek(0)
        t.addfile(info, data)
md5 = lambda name: hashlib.md5(open(name, "rb").read()).hexdigest()
with open("served/dataset-room_512_16.tar.md5", "w") as f:
    f.write(md5("served/dataset-room_512_16.tar") + "  dataset-room_512_16.tar\n")
print(md5("served/hall.zip"), file=open("hall.md5", "w"))
PYTHON
# The first answer for hall.zip ends after a third of it.
cat >"$work/server.py" <<'PYTHON'
import http.server, os, sys
class Handler(http.server.BaseHTTPRequestHandler):
    cut = {"/hall.zip"}
    def do_GET(self):
        if not os.path.exists("served" + self.path):
            return self.send_error(404)
        body = open("served" + self.path, "rb").read()
        first = int(self.headers.get("Range", "bytes=0-")[6:].split("-")[0])
        print(self.path, first, flush=True)
        self.send_response(206 if first else 200)
        self.send_header("Content-Length", len(body) - first)
        self.send_header("Content-Range", f"bytes {first}-{len(body) - 1}/{len(body)}")
        self.end_headers()
        end = len(body) // 3 if self.path in self.cut else len(body)
        self.cut.discard(self.path)
        self.wfile.write(body[first:end])
    def log_message(self, *_): pass
server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
print(server.server_port, file=open("port.new", "w"))
os.rename("port.new", "port")
server.serve_forever()
PYTHON
(cd "$work" && exec python3 server.py >requests) &
server=$!
for _ in {1..100}; do [[ -s $work/port ]] && break; sleep 0.1; done
address=http://127.0.0.1:$(<"$work/port")
cat >"$work/list" <<LIST
# a comment
hall    euroc $(<"$work/hall.md5") $address/hall.zip
damaged euroc $(<"$work/hall.md5") $address/damaged.zip
gone    euroc $(<"$work/hall.md5") $address/gone.zip
room    tumvi beside $address/dataset-room_512_16.tar
nowhere euroc $(<"$work/hall.md5") http://127.0.0.1:1/hall.zip
LIST

expect "the names" 0 'euroc: hall damaged gone nowhere.*tumvi: room'
expect "a name of none" 1 'error: no recording hill; expected one of these:.*euroc: hall damaged' hill
mkdir -p "$work/data/euroc/B_easy/mine"
expect "a cut download" 0 'euroc/A_easy.*euroc/B_easy is there already and stays' hall
check "it goes on where it was cut" grep -qE '^/hall.zip [1-9]' "$work/requests"
check "a sequence is unpacked" test -s "$work/data/euroc/A_easy/mav0/imu0/data.csv"
check "what was there stays" test -d "$work/data/euroc/B_easy/mine" -a ! -e "$work/data/euroc/B_easy/mav0"
check "no archive stays" test ! -e "$work/data/downloads/hall" -a ! -e "$work/data/downloads/hall.unpacked"
expect "fetched before" 0 'hall was fetched before' hall
expect "the publisher's checksum, a tar" 0 'tumvi/room' room
check "its calibration" test -s "$work/data/tumvi/room/dso/camchain.yaml"
expect "another archive" 1 'damaged.zip: the checksum is [0-9a-f]{32}; expected [0-9a-f]{32}\. The file is deleted' damaged
check "a wrong archive goes" test ! -e "$work/data/downloads/damaged"
expect "an address that is gone" 1 'gone.zip: the download failed' gone
expect "no network" 1 'error: no connection to 127.0.0.1:1; expected a network' nowhere
exit "$failed"
