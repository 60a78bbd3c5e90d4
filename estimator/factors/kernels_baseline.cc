#include "estimator/simd/baseline.inc"
// the target before its kernels
#include "estimator/factors/kernels.inc"
