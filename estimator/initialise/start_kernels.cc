#include "estimator/initialise/start_kernels.h"

namespace epiline {

#if defined(__x86_64__)
namespace kernels_avx512 {
extern const StartKernels start_table;
}
namespace kernels_avx2 {
extern const StartKernels start_table;
}
#endif
namespace kernels_baseline {
extern const StartKernels start_table;
}

const StartKernels& start_kernels([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return kernels_avx512::start_table;
  if (set == InstructionSet::kAvx2) return kernels_avx2::start_table;
#endif
  return kernels_baseline::start_table;
}

}  // namespace epiline
