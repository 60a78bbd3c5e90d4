#pragma once
// Compares the speeds of the wheels with those of the vehicle. Derivation: docs/derivations/wheel.md#words; test:
// tests/estimator/monitor/wheel_watch_test.cc.
#include "estimator/statistics.h"

namespace epiline {

/// Remembers some seconds, and fits a scale and a delay to them. A word is for good, since its cause passes unseen.
class WheelWatch {
 public:
  /// `scale_sigma`: relative, as the estimator believes the wheels.
  explicit WheelWatch(double scale_sigma) noexcept : scale_sigma_(scale_sigma) {}
  /// Means over an interval between frames.
  struct Interval {
    double dt_s;
    double read_m_s, true_m_s;  ///< by the wheels; as estimated
    double gained_m_s2;         ///< true acceleration
    double variance_true, variance_read;
  };
  void add(const Interval& interval) noexcept;
  /// The speeds read stay the same although the vehicle's change.
  bool is_stuck() const noexcept { return stuck_; }
  const Suspicion& operator[](Suspect suspect) const noexcept { return found_[index(suspect)]; }

 private:
  static constexpr int index(Suspect s) { return static_cast<int>(s) - static_cast<int>(Suspect::kWheelScale); }
  void watch_stuck(const Interval& interval) noexcept;
  void fit() noexcept;

  double scale_sigma_;
  double z_ = 0, least_ = 0, most_ = 0, same_s_ = 0;  ///< since the reading last changed
  bool stuck_ = false;
  /// Integrals over time with forgetting, of products of speed read, true speed and its rate; of the variances.
  double time_s_ = 0, zz_ = 0, zu_ = 0, uu_ = 0, za_ = 0, ua_ = 0, aa_ = 0, noise_true_ = 0, noise_read_ = 0;
  std::array<Suspicion, 4> found_;
};

/// As notes: wheels that do not fit are not believed, so the flight need not be distrusted.
void add_suspicions(const WheelWatch& watch, Suspicions& suspicions) noexcept;

}  // namespace epiline
