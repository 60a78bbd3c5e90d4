#if defined(__x86_64__)
#define TARGET laboratory_avx512
#define LANES 8
#include "drivers/laboratory/factors/kernels.inc"
#endif
