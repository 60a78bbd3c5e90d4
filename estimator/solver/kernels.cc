#include "estimator/solver/kernels.h"

#include <cstring>

namespace epiline {

#if defined(__x86_64__)
namespace kernels_sse {
extern const Kernels table;
}
namespace kernels_avx2 {
extern const Kernels table;
}
namespace kernels_avx512 {
extern const Kernels table;
}

namespace {
bool runs(const Kernels& k) {
  if (&k == &kernels_avx512::table)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl");
  if (&k == &kernels_avx2::table) return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return true;
}
const Kernels* const kAll[] = {&kernels_avx512::table, &kernels_avx2::table, &kernels_sse::table};
}  // namespace
#else
namespace kernels_generic {
extern const Kernels table;
}
namespace {
bool runs(const Kernels&) { return true; }
const Kernels* const kAll[] = {&kernels_generic::table};
}  // namespace
#endif

const Kernels* kernels_named(const char* name) {
  for (const Kernels* k : kAll)
    if (std::strcmp(k->name, name) == 0) return runs(*k) ? k : nullptr;
  return nullptr;
}

const Kernels& kernels() {
  for (const Kernels* k : kAll)
    if (runs(*k)) return *k;
  return *kAll[sizeof kAll / sizeof *kAll - 1];
}

int LinearSystem::pose_dim() const { return 6 * frames + kCalibration; }

}  // namespace epiline
