#if defined(__x86_64__)
#define TARGET kernels_sse
#define NAME "sse"
#define LANES 2
#else
#define TARGET kernels_generic
#if defined(__aarch64__)
#define NAME "neon"
#else
#define NAME "generic"
#endif
#define LANES 2
#endif
#include "estimator/solver/kernels.inc"
