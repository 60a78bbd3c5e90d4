#if defined(__x86_64__)
#define TARGET laboratory_avx2
#define LANES 4
#include "drivers/laboratory/factors/kernels.inc"
#endif
