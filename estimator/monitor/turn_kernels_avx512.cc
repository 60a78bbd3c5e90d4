#if defined(__x86_64__)
#include "estimator/simd/avx512.inc"
// the target before its kernels
#include "estimator/monitor/turn_kernels.inc"
#endif
