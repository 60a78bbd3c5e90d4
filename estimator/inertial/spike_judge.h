#pragma once
// Is a reading of the IMU a measurement or a corrupt value? docs/derivations/imu.md, "Corrupt readings", has the rules.
#include "estimator/geometry/types.h"
#include "platform/time/clock.h"

namespace epiline {

/// Whether no inertial sensor can have measured this: not finite, all six values exactly zero, beyond 100 rad/s or
/// 1000 m/s^2.
bool is_impossible(const Vec3& angular_velocity_rad_s, const Vec3& specific_force_m_s2) noexcept;

/// Learns how often readings come.
class ReadingPeriod {
 public:
  /// A later stamp. True: after a hole.
  bool step(HostStamp stamp) noexcept;
  double seconds() const noexcept { return period_s_; }  ///< 0 before the second stamp
  /// Readings further apart have a hole between them: 2.5 periods, 4 ms at least.
  double hole_s() const noexcept;

 private:
  bool any_ = false;
  HostStamp last_;
  double period_s_ = 0;
};

/// Judges each reading by its neighbours: at once by those before it, finally by the next one. A pure object: no clock,
/// no heap, the same work for every reading.
class SpikeJudge {
 public:
  /// Departures that do little harm, whatever is usual, rad/s and m/s^2.
  static constexpr double kLeastRate = 0.4, kLeastForce = 3;

  /// What a new reading shows about the suspects before it.
  enum class Past : std::uint8_t {
    kOpen,    ///< nothing yet; or there are none
    kReal,    ///< they were measurements
    kSpikes,  ///< they stand alone: bridge them
    kGap,     ///< too many to bridge: a gap. The new reading is a suspect, too, until the next one agrees with it
  };
  /// Standard deviations of a value put in place of a suspect.
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

  /// One possible reading (see is_impossible), later than the last one. `after_gap`: readings are missing before it.
  Verdict step(HostStamp stamp, const Vec3& w, const Vec3& a, bool after_gap) noexcept;

  /// Whether spikes come several times a second.
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
  Unknown unknown(bool alone) const noexcept;
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
