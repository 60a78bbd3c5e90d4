#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace epiline {

/// The usual time between readings, and how many are missing when one takes longer. It follows the median, by a fixed
/// share at a time, so missing and doubled readings do not move it far.
class IntervalTracker {
 public:
  IntervalTracker() = default;
  explicit IntervalTracker(double usual_ns) noexcept : usual_ns_(usual_ns) {}

  double usual_ns() const noexcept { return usual_ns_; }  ///< 0: nothing known

  /// `passed_ns` > 0 since the reading before. Returns how many are missing between the two.
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
