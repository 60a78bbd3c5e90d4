#pragma once
// Latencies of a run of any length in fixed memory.
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace epiline {

/// Counts by bins that are 1/16 octave wide or less: a quantile is off by 6 % at most. One thread at a time.
class LatencyBins {
 public:
  void add(std::int64_t ns) noexcept {
    const auto value = static_cast<std::uint64_t>(std::max<std::int64_t>(ns, 0));
    ++counts_[bin_of(value)];
    ++count_;
    most_ns_ = std::max(most_ns_, ns);
  }
  std::uint64_t count() const noexcept { return count_; }
  std::int64_t most_ns() const noexcept { return most_ns_; }
  /// The upper edge of the bin below or in which `share` of the values lie, and no more than the largest; 0: none yet.
  std::int64_t quantile_ns(double share) const noexcept {
    const double wanted = share * static_cast<double>(count_);
    std::uint64_t below = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      below += counts_[i];
      if (below > 0 && static_cast<double>(below) >= wanted)
        return std::min(static_cast<std::int64_t>(upper_edge(i)), most_ns_);
    }
    return most_ns_;
  }

 private:
  // Values below 16 have a bin each; above, the four bits after the leading one choose among the octave's bins.
  static constexpr std::size_t kPerOctave = 16, kBins = 61 * kPerOctave;
  static std::size_t bin_of(std::uint64_t value) noexcept {
    if (value < kPerOctave) return static_cast<std::size_t>(value);
    const auto shift = static_cast<std::size_t>(std::bit_width(value)) - 5;
    return kPerOctave * shift + static_cast<std::size_t>(value >> shift);
  }
  static std::uint64_t upper_edge(std::size_t bin) noexcept {
    if (bin < kPerOctave) return bin;
    const std::size_t shift = bin / kPerOctave - 1;
    return ((bin % kPerOctave + kPerOctave + 1) << shift) - 1;
  }

  std::array<std::uint64_t, kBins> counts_{};
  std::uint64_t count_ = 0;
  std::int64_t most_ns_ = 0;
};

}  // namespace epiline
