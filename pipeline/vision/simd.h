#pragma once
// Included by every kernel before Highway. Kernels keep vectors in structs, which targets with vectors of unknown size
// (SVE, RVV) do not allow; those machines use NEON or what else they have.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
