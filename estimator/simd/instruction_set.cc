#include "estimator/simd/instruction_set.h"

namespace epiline {

const char* name_of(InstructionSet set) {
#if defined(__x86_64__)
  constexpr const char* kNames[] = {"avx512", "avx2", "sse"};
#elif defined(__aarch64__)
  constexpr const char* kNames[] = {"neon"};
#else
  constexpr const char* kNames[] = {"generic"};
#endif
  return kNames[static_cast<int>(set)];
}

bool runs_here([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl");
  if (set == InstructionSet::kAvx2) return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#endif
  return true;
}

InstructionSet best_instruction_set() {
  for (const InstructionSet set : kInstructionSets)
    if (runs_here(set)) return set;
  return kInstructionSets[sizeof kInstructionSets / sizeof *kInstructionSets - 1];
}

}  // namespace epiline
