#include "estimator/kernels.h"

namespace epiline {

#if defined(__x86_64__)
namespace kernels_avx512 {
extern const KernelTables tables;
}
namespace kernels_avx2 {
extern const KernelTables tables;
}
#endif
namespace kernels_baseline {
extern const KernelTables tables;
}

namespace {
const KernelTables& tables_of([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return kernels_avx512::tables;
  if (set == InstructionSet::kAvx2) return kernels_avx2::tables;
#endif
  return kernels_baseline::tables;
}
}  // namespace

const FactorKernels& factor_kernels(InstructionSet set) { return tables_of(set).factors; }
const StartKernels& start_kernels(InstructionSet set) { return tables_of(set).starts; }
const TurnKernels& turn_kernels(InstructionSet set) { return tables_of(set).turns; }
const EliminationKernels& elimination_kernels(InstructionSet set) { return tables_of(set).elimination; }

}  // namespace epiline
