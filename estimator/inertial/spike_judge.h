#pragma once
// Decides whether an IMU sample is a measurement or corrupt. The rules: docs/derivations/imu.md, "Corrupt readings".
#include "estimator/geometry/types.h"
#include "platform/time/clock.h"

namespace epiline {

/// True if no inertial sensor can measure this: not finite, all six values exactly zero, or beyond 100 rad/s or
/// 1000 m/s^2.
bool is_impossible(const Vec3& angular_velocity_rad_s, const Vec3& specific_force_m_s2) noexcept;

/// Learns the interval between samples.
class ReadingPeriod {
 public:
  /// Adds a later timestamp. True: after a gap.
  bool step(HostStamp stamp) noexcept;
  double seconds() const noexcept { return period_s_; }  ///< 0 before the second stamp
  /// A longer interval is a gap: 2.5 periods, at least 4 ms.
  double hole_s() const noexcept;

 private:
  bool any_ = false;
  HostStamp last_;
  double period_s_ = 0;
};

/// Judges each sample by its neighbours: provisionally by the previous ones, finally by the next one. No clock, no
/// heap, the same work for every sample.
class SpikeJudge {
 public:
  /// Departures that do little harm, whatever is usual, rad/s and m/s^2.
  static constexpr double kLeastRate = 0.4, kLeastForce = 3;

  /// The verdict of a new sample on the suspects before it.
  enum class Past : std::uint8_t {
    kOpen,    ///< no verdict yet, or no suspects
    kReal,    ///< they were measurements
    kSpikes,  ///< they are corrupt: replace them
    kGap,     ///< too many to replace: a gap. The new sample is a suspect too, until the next one agrees with it
  };
  /// Standard deviations of the value that replaces a suspect.
  struct Unknown {
    float rate_rad_s = 0, force_m_s2 = 0;
  };
  struct Verdict {
    bool suspect = false;        ///< the new reading
    Past past = Past::kOpen;     ///< the suspects directly before it ...
    int past_count = 0;          ///< ... and how many there are
    bool base_is_spike = false;  ///< the reading before those, believed for want of neighbours, is a spike
    Unknown unknown;             ///< of the new reading if it is suspect, and of those before it after kSpikes and kGap
  };

  /// Judges a sample that is not is_impossible() and later than the last one. `after_gap`: samples are missing before
  /// it.
  Verdict step(HostStamp stamp, const Vec3& w, const Vec3& a, bool after_gap) noexcept;

  /// Of the values put in the places of readings that did not come, so many in a row.
  Unknown unknown_of_lost(int in_a_row) const noexcept;

  /// True if spikes come several times a second.
  bool persists() const noexcept { return recent_ > kPersistent; }
  void clear() noexcept { *this = {}; }

 private:
  static constexpr double kPersistent = 3;  // spikes, each forgotten with a time constant of a second
  struct Point {
    HostStamp stamp;
    Vec3 w = Vec3::Zero(), a = Vec3::Zero();
  };

  Vec3 rate_limit() const noexcept;
  Vec3 force_limit() const noexcept;
  double distance(const Point& x, const Point& y) const noexcept;
  double departure(const Point& r) const noexcept;
  Point on_line(const Point& from, const Point& to, HostStamp t) const noexcept;
  Past past(const Point& r) const noexcept;
  bool agrees(const Point& r) const noexcept;
  void learn(const Point& r, double share) noexcept;
  void believe(const Point& r) noexcept;
  void suspect(const Point& r) noexcept;
  Verdict begin_anew(const Point& r, Verdict v) noexcept;
  Unknown unknown() const noexcept;
  void forget(HostStamp now) noexcept;

  Point base_, before_base_;  // the last readings believed
  bool any_ = false, has_before_ = false;
  bool base_alone_ = true;                   // nothing has confirmed the base yet
  Point suspect_;                            // the newest suspect
  int suspects_ = 0;                         // in a row
  double worst_rate_ = 0, worst_force_ = 0;  // how far they depart from the base
  // usual departures of each axis, rad/s and m/s^2
  Vec3 rate_scale_ = Vec3::Constant(0.2), force_scale_ = Vec3::Constant(2);
  double suspect_share_ = 0;  // of the last few readings
  double recent_ = 0;
  HostStamp recent_at_;
};

}  // namespace epiline
