#pragma once
#include <array>
#include <cstdint>

#include "estimator/geometry/types.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/preintegration.h"
#include "platform/samples/samples.h"

namespace epiline {

/// The last few seconds of IMU readings, and integration between any two instants of them.
class ImuHistory {
 public:
  enum class Push : std::uint8_t { kTaken, kOutOfOrder, kDuplicate, kNotFinite };
  struct Reading {
    HostStamp stamp;
    Vec3 w, a;                ///< rad/s, m/s^2, in B
    bool distrusted = false;  ///< at a limit or stuck: as good as none
  };
  struct Density {
    ImuNoise noise;               ///< as assumed by the estimator
    double gap_acceleration = 2;  ///< m/s^2, unknown acceleration across a gap
    double gap_rate = 0.5;        ///< rad/s
  };

  Push push(const ImuSample& sample);
  void clear() { count_ = 0; }
  bool empty() const { return count_ == 0; }
  const Reading& newest() const { return at(count_ - 1); }
  HostStamp oldest_stamp() const { return at(first()).stamp; }
  /// Typical distance of readings, s; 0 before the second one.
  double period() const { return period_; }
  /// Whether the newest reading came after a hole of more than 2.5 periods.
  bool after_gap() const { return after_gap_; }

  /// The longest time between t0 and t1, or ending there, without a reading to be trusted; s.
  double longest_unknown_s(HostStamp t0, HostStamp t1) const;
  /// Whether the readings go up to t, but for what is no gap.
  bool reaches(HostStamp t) const;

  /// Preintegrates from t0 to t1 at the biases set in `out`; readings are interpolated at both ends, the newest one
  /// holds beyond the end. Returns false, leaving `out` as it was, if and only if the readings end more than half a
  /// second before t1 or begin as much after t0.
  bool integrate(HostStamp t0, HostStamp t1, const Density& density, Preintegration& out) const;
  /// State moved from t0 to t1 without covariances; `omega`: the rate at t1, bias included.
  void propagate(HostStamp t0, HostStamp t1, NavState& x, Vec3& omega) const;
  /// Mean of |w - b_g| over readings from t0 to t1.
  double mean_rate(HostStamp t0, HostStamp t1, const Vec3& b_g) const;
  /// Calls visit(reading) for the readings in [t0, t1].
  template <class F>
  void each(HostStamp t0, HostStamp t1, F&& visit) const {
    for (std::uint64_t i = first(); i < count_; ++i)
      if (at(i).stamp >= t0 && at(i).stamp <= t1) visit(at(i));
  }

 private:
  static constexpr std::uint64_t kCapacity = 4096;  // 20 s at 200 Hz, 4 s at 1 kHz
  std::uint64_t first() const { return count_ > kCapacity ? count_ - kCapacity : 0; }
  const Reading& at(std::uint64_t i) const { return readings_[i % kCapacity]; }
  /// Index of the last reading at or before t, or the first one.
  std::uint64_t before(HostStamp t) const;
  Reading interpolated(std::uint64_t i, HostStamp t) const;
  /// Calls visit(r0, r1, dt) for the pieces of [t0, t1].
  template <class F>
  void pieces(HostStamp t0, HostStamp t1, F&& visit) const;

  std::array<Reading, kCapacity> readings_;
  std::uint64_t count_ = 0;
  double period_ = 0;
  bool after_gap_ = false;
};

}  // namespace epiline
