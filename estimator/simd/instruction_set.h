#pragma once
// Which instruction sets the kernels were compiled for, and which of them this processor can run. Plain data: the
// kernels' sources include it.

namespace epiline {

inline constexpr int kBatchLanes = 8;  ///< numbers side by side in a batch, whatever the vector width

enum class InstructionSet : unsigned char {
#if defined(__x86_64__)
  kAvx512,
  kAvx2,
  kSse,
#elif defined(__aarch64__)
  kNeon,
#else
  kGeneric,
#endif
};

/// All that were compiled, the widest first.
inline constexpr InstructionSet kInstructionSets[] = {
#if defined(__x86_64__)
    InstructionSet::kAvx512, InstructionSet::kAvx2, InstructionSet::kSse
#elif defined(__aarch64__)
    InstructionSet::kNeon
#else
    InstructionSet::kGeneric
#endif
};

/// "avx512", "avx2", "sse", "neon" or "generic".
const char* name_of(InstructionSet set);
bool runs_here(InstructionSet set);
/// The widest one that runs here.
InstructionSet best_instruction_set();

}  // namespace epiline
