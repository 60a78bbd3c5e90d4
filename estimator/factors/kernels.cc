#include "estimator/factors/kernels.h"

namespace epiline {

#if defined(__x86_64__)
namespace kernels_avx512 {
extern const FactorKernels factor_table;
}
namespace kernels_avx2 {
extern const FactorKernels factor_table;
}
#endif
namespace kernels_baseline {
extern const FactorKernels factor_table;
}

const FactorKernels& factor_kernels([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return kernels_avx512::factor_table;
  if (set == InstructionSet::kAvx2) return kernels_avx2::factor_table;
#endif
  return kernels_baseline::factor_table;
}

}  // namespace epiline
