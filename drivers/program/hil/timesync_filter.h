#pragma once
// Models how PX4 estimates the offset of a companion's clock from TIMESYNC (mavlink_timesync.h), to check our answers.
#include <cstdint>

namespace epiline::hil {

class TimesyncFilter {
 public:
  static constexpr int kConvergence = 500;  ///< exchanges until the clocks are known
  static constexpr std::int64_t kRoundTripMost_ns = 10'000'000;

  enum class Outcome : std::uint8_t { kUsed, kSlow, kDeviates, kReset };

  /// Takes one exchange. `other_ns` is on the companion's clock, the other two on the controller's. Six deviations in a
  /// row beyond 100 ms reset the filter.
  Outcome update(std::int64_t sent_ns, std::int64_t other_ns, std::int64_t received_ns);

  bool converged() const { return count_ >= kConvergence; }
  int count() const { return count_; }
  /// Controller minus companion; 0 before the first exchange.
  std::int64_t offset_ns() const { return static_cast<std::int64_t>(offset_ns_); }

 private:
  void smooth(double offset_ns);

  int count_ = 0, deviations_ = 0;
  double offset_ns_ = 0, drift_ns_ = 0;  ///< drift: change of the offset from one exchange to the next
};

}  // namespace epiline::hil
