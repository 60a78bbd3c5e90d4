#pragma once
// The median of the last values.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace epiline {

template <std::size_t N>
class RecentMedian {
 public:
  void add(std::int64_t value) noexcept { values_[count_++ % N] = value; }
  void clear() noexcept { count_ = 0; }
  /// Median of the last N values; `otherwise` while there are fewer.
  std::int64_t value_or(std::int64_t otherwise) const noexcept {
    if (count_ < N) return otherwise;
    auto sorted = values_;
    std::nth_element(sorted.begin(), sorted.begin() + N / 2, sorted.end());
    return sorted[N / 2];
  }

 private:
  std::array<std::int64_t, N> values_{};
  std::size_t count_ = 0;
};

}  // namespace epiline
