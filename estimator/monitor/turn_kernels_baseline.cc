#include "estimator/simd/baseline.inc"
// the target before its kernels
#include "estimator/monitor/turn_kernels.inc"
