#include "drivers/laboratory/factors/kernels.h"

namespace epiline {

#if defined(__x86_64__)
namespace laboratory_avx512 {
extern const LaboratoryKernels kernels;
}
namespace laboratory_avx2 {
extern const LaboratoryKernels kernels;
}
#endif
namespace laboratory_baseline {
extern const LaboratoryKernels kernels;
}

const LaboratoryKernels& laboratory_kernels([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return laboratory_avx512::kernels;
  if (set == InstructionSet::kAvx2) return laboratory_avx2::kernels;
#endif
  return laboratory_baseline::kernels;
}

}  // namespace epiline
