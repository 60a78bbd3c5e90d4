#include "estimator/monitor/turn_kernels.h"

namespace epiline {

#if defined(__x86_64__)
namespace kernels_avx512 {
extern const TurnKernels turn_table;
}
namespace kernels_avx2 {
extern const TurnKernels turn_table;
}
#endif
namespace kernels_baseline {
extern const TurnKernels turn_table;
}

const TurnKernels& turn_kernels([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return kernels_avx512::turn_table;
  if (set == InstructionSet::kAvx2) return kernels_avx2::turn_table;
#endif
  return kernels_baseline::turn_table;
}

}  // namespace epiline
