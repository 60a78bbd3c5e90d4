#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace epiline {

/// The usual interval between samples, and the number of missing samples in a longer one. It follows the median in
/// steps of a fixed ratio, so missing and repeated samples hardly change it.
class IntervalTracker {
 public:
  IntervalTracker() = default;
  explicit IntervalTracker(double usual_ns) noexcept : usual_ns_(usual_ns) {}

  double usual_ns() const noexcept { return usual_ns_; }  ///< 0: unknown

  /// `passed_ns` > 0: time since the previous sample. Returns the number of samples missing in between.
  std::uint64_t note(std::int64_t passed_ns) noexcept {
    const auto passed = static_cast<double>(passed_ns);
    if (usual_ns_ <= 0) {
      usual_ns_ = passed;
      return 0;
    }
    if (passed > 1.5 * usual_ns_) {
      const double before_ns = usual_ns_;
      least_long_ns_ = longs_in_row_ == 0 ? passed : std::min(least_long_ns_, passed);
      if (++longs_in_row_ == kNewRate) {  // not one reading in time: the rate is another
        usual_ns_ = least_long_ns_;
        longs_in_row_ = 0;
      }
      return static_cast<std::uint64_t>(std::min(std::round(passed / before_ns), 1e9)) - 1;
    }
    longs_in_row_ = 0;
    usual_ns_ *= passed > usual_ns_ ? 1 + kShare : 1 - kShare;
    return 0;
  }

 private:
  static constexpr double kShare = 0.02;
  static constexpr int kNewRate = 8;

  double usual_ns_ = 0, least_long_ns_ = 0;
  int longs_in_row_ = 0;
};

}  // namespace epiline
