#include "estimator/simd/baseline.inc"
// the target before its kernels
#include "estimator/solver/elimination.inc"
