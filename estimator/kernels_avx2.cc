#if defined(__x86_64__)
#define TARGET kernels_avx2
#define LANES 4
#include "estimator/kernels.inc"
#endif
