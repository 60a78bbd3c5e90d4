#include "estimator/simd/baseline.inc"
// the target before its kernels
#include "estimator/initialise/start_kernels.inc"
