// What every processor of the kind has: SSE2 on x86-64, NEON on 64-bit ARM.
#define TARGET laboratory_baseline
#define LANES 2
#include "drivers/laboratory/factors/kernels.inc"
