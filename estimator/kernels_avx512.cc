#if defined(__x86_64__)
#define TARGET kernels_avx512
#define LANES 8
#include "estimator/kernels.inc"
#endif
