#include "estimator/solver/linear_system.h"

namespace epiline {

#if defined(__x86_64__)
namespace kernels_avx512 {
extern const EliminationKernels elimination_table;
}
namespace kernels_avx2 {
extern const EliminationKernels elimination_table;
}
#endif
namespace kernels_baseline {
extern const EliminationKernels elimination_table;
}

const EliminationKernels& elimination_kernels([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return kernels_avx512::elimination_table;
  if (set == InstructionSet::kAvx2) return kernels_avx2::elimination_table;
#endif
  return kernels_baseline::elimination_table;
}

}  // namespace epiline
