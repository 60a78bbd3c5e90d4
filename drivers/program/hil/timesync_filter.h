#pragma once
// How PX4 estimates a companion's clock from TIMESYNC: behaviour of mavlink_timesync.h, to see whether our answers
// serve it.
#include <cstdint>

namespace epiline::hil {

class TimesyncFilter {
 public:
  static constexpr int kConvergence = 500;  ///< exchanges until the clocks are known
  static constexpr std::int64_t kRoundTripMost_ns = 10'000'000;

  enum class Outcome : std::uint8_t { kUsed, kSlow, kDeviates, kReset };

  /// All of the controller's clock but `other_ns`. The sixth deviation in a row beyond 100 ms starts the filter anew.
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
