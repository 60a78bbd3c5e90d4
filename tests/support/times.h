#pragma once
// Times in nanoseconds, as tests write them.
#include <cstdint>

namespace epiline {

inline constexpr std::int64_t kMs = 1'000'000, kSecond = 1'000'000'000;
inline constexpr std::int64_t kStart_ns = 1'000 * kSecond;  ///< where a test's clock begins when it does not matter

}  // namespace epiline
