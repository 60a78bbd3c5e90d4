#pragma once

namespace epiline {

/// Name of the instruction set the image kernels use on this machine, for instance "AVX2".
const char* simd_target() noexcept;

}  // namespace epiline
