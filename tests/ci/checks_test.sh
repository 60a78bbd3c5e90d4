#!/usr/bin/env bash
# usage: checks_test.sh ROOT. Shows .ci/check_includes and .ci/check_docs a small tree with one fault at a time: a sound tree
# passes, and every fault is reported with the file that holds it.
set -uo pipefail
root=$(realpath "$1")
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
failed=0

sound_tree() {
  rm -rf "${tree:?}"/*
  mkdir -p "$tree"/{platform/linux,estimator/{geometry,window,factors,solver,monitor},pipeline/{text,config,stages},drivers/{links/{stream,can},sensors,flights,study,laboratory},tests,docs/derivations}
  printf '#include <vector>\n#include "platform/a.h"\n' >"$tree/platform/a.cc"
  printf '#include <sys/mman.h>\n' >"$tree/platform/linux/l.cc"
  printf '// Derivation: docs/derivations/e.md\n#include <Eigen/Core>\n#include <cmath>\n#include "platform/a.h"\n' >"$tree/estimator/e.h"
  printf '#include <hwy/highway.h>\n#include <vector>\n#include "estimator/e.h"\n' >"$tree/pipeline/p.cc"
  printf '#include <png.h>\n#include "pipeline/p.h"\n' >"$tree/drivers/d.cc"
  printf '#include "pipeline/p.h"\n' >"$tree/drivers/laboratory/l.cc"
  printf '// docs/derivations/e.md\n' >"$tree/tests/e_test.cc"
  printf '# E\n\nCode: estimator/e.h\nTest: tests/e_test.cc\n\n[up](../index.md) [net](https://example.org) [part](#e)\n' >"$tree/docs/derivations/e.md"
  printf '# Index\n' >"$tree/docs/index.md"
}

# expect_fault CHECK FILE TEXT: FILE with TEXT appended must be reported by CHECK under that file's name.
expect_fault() {
  local output
  sound_tree
  printf '%s\n' "$3" >>"$tree/$2"
  if output=$("$root/.ci/$1" "$tree" 2>&1) || [[ $output != *"$2"* ]]; then
    printf '%s: fault not reported: %s: %s\n%s\n' "$1" "$2" "$3" "$output"
    failed=1
  fi
}

sound_tree
for check in check_includes check_docs; do
  "$root/.ci/$check" "$tree" || { echo "$check refuses a sound tree"; failed=1; }
done
expect_fault check_includes platform/a.cc '#include "estimator/e.h"'
expect_fault check_includes platform/a.cc '#include <Eigen/Core>'
expect_fault check_includes platform/a.cc '#include <sys/mman.h>'
expect_fault check_includes platform/linux/l.cc '#include "pipeline/p.h"'
expect_fault check_includes estimator/e.h '#include "pipeline/p.h"'
expect_fault check_includes estimator/e.h '#include "e2.h"'
expect_fault check_includes estimator/e.h '  #  include <vector>'
expect_fault check_includes estimator/e.h '#include <thread>'
expect_fault check_includes estimator/e.h '#include <chrono> // only here'
expect_fault check_includes estimator/e.h '#include <opencv2/core.hpp>'
expect_fault check_includes estimator/window/w.h '#include "estimator/factors/f.h"'
expect_fault check_includes estimator/factors/f.h '#include "estimator/solver/s.h"'
expect_fault check_includes estimator/monitor/m.h '#include "estimator/predict/p.h"'
expect_fault check_includes estimator/solver/s.h '#include "estimator/estimator.h"'
expect_fault check_includes estimator/geometry/g.h '#include "estimator/config.h"'
expect_fault check_includes pipeline/p.cc '#include "drivers/d.h"'
expect_fault check_includes pipeline/p.cc '#include <opencv2/core.hpp>'
expect_fault check_includes pipeline/text/t.h '#include "pipeline/config/c.h"'
expect_fault check_includes pipeline/config/c.h '#include "pipeline/stages/s.h"'
expect_fault check_includes drivers/study/s.h '#include "drivers/laboratory/l.h"'
expect_fault check_includes drivers/laboratory/l.cc '#include "l2.h"'
expect_fault check_includes drivers/links/l.h '#include "drivers/sensors/s.h"'
expect_fault check_includes drivers/links/stream/o.h '#include "drivers/links/mavlink/m.h"'
expect_fault check_includes drivers/links/can/c.h '#include "drivers/links/mavlink/m.h"'
expect_fault check_includes drivers/sensors/s.h '#include "drivers/flights/f.h"'
expect_fault check_includes drivers/sensors/s.h '#include "pipeline/stages/s.h"'
expect_fault check_includes drivers/flights/f.h '#include "drivers/study/s.h"'
expect_fault check_includes drivers/study/s.h '#include "drivers/program/p.h"'
expect_fault check_includes drivers/d.cc '#include <opencv2/core.hpp>'
expect_fault check_includes drivers/d.cc '#include "d.h"'
expect_fault check_docs docs/index.md '[gone](nowhere.md)'
expect_fault check_docs docs/derivations/e.md 'Code: estimator/missing.h'
expect_fault check_docs docs/derivations/e.md 'Test: tests/missing_test.cc'
expect_fault check_docs docs/derivations/f.md '# F has neither code nor test'
expect_fault check_docs estimator/e.h '// see docs/derivations/missing.md'

# A page whose code or test does not name it back.
for silent in estimator/e.h tests/e_test.cc; do
  sound_tree
  echo >"$tree/$silent"
  "$root/.ci/check_docs" "$tree" >/dev/null && { echo "check_docs: $silent is silent about its page"; failed=1; }
done
exit "$failed"
