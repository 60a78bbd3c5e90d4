#pragma once
#include <array>
#include <cstdint>
#include <optional>

#include "estimator/geometry/types.h"
#include "estimator/inertial/interpolator.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/preintegration.h"
#include "estimator/inertial/spike_judge.h"
#include "platform/samples/samples.h"

namespace epiline {

/// The last few seconds of IMU readings, and integration between any two instants of them.
class ImuHistory {
 public:
  enum class Push : std::uint8_t {
    kTaken,
    kOutOfOrder,
    kDuplicate,
    kNotFinite,
    kImpossible,  ///< no sensor measures that (is_impossible): left out
    kFarAhead,    ///< kept aside: taken with the next reading if that confirms its stamp
  };
  struct Reading {
    HostStamp stamp;
    Vec3 w, a;                ///< rad/s, m/s^2, in B
    bool distrusted = false;  ///< at a limit or stuck: as good as none
    bool suspect = false;     ///< alone, as far as its neighbours are known: a value between them stands in its place
    bool replaced = false;    ///< of a suspect: the values of the corrupt axes have been replaced by likely ones
    bool in_gap = false;      ///< one of too many suspects in a row: as good as none
    SpikeJudge::Unknown unknown{};  ///< of a suspect
  };
  struct Counts {
    std::uint64_t suspects = 0;  ///< readings that left what came before them
    std::uint64_t bridged = 0;   ///< readings that stood alone: corrupt
    std::uint64_t gaps = 0;      ///< bursts too long to bridge
  };
  struct Density {
    ImuNoise noise;               ///< as assumed by the estimator
    double gap_acceleration = 2;  ///< m/s^2, unknown acceleration across a gap
    double gap_rate = 0.5;        ///< rad/s
  };

  Push push(const ImuSample& sample);
  void clear();
  bool empty() const { return count_ == 0; }
  /// While the newest reading is a suspect, it has the values of the one before it.
  Reading newest() const { return value(count_ - 1); }
  bool newest_is_suspect() const { return count_ > 0 && at(count_ - 1).suspect; }
  const Counts& counts() const { return counts_; }
  /// An instant after which integrals differ from those before the last call, because a verdict on readings became
  /// final; none if none did.
  std::optional<HostStamp> take_revised();
  /// Whether corrupt readings come several times a second.
  bool spikes_persist() const { return judge_.persists(); }
  HostStamp oldest_stamp() const { return at(first()).stamp; }
  /// Typical distance of readings, s; 0 before the second one.
  double period() const { return period_.seconds(); }
  /// Whether the newest reading came after a hole of more than 2.5 periods, or ended a burst of suspects too long to
  /// bridge.
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
    if (count_ == 0) return;
    for (std::uint64_t i = before(t0); i < count_ && at(i).stamp <= t1; ++i)
      if (at(i).stamp >= t0) visit(value(i));
  }

 private:
  static constexpr std::uint64_t kCapacity = 4096;  // 20 s at 200 Hz, 4 s at 1 kHz
  std::uint64_t first() const { return count_ > kCapacity ? count_ - kCapacity : 0; }
  const Reading& at(std::uint64_t i) const { return readings_[i % kCapacity]; }
  Reading& at(std::uint64_t i) { return readings_[i % kCapacity]; }
  /// A reading; in place of a suspect the line between its neighbours, or the one before it until there is another.
  Reading value(std::uint64_t i) const;
  HostStamp newest_stamp() const { return at(count_ - 1).stamp; }
  void take(Reading reading);
  void judge(Reading& reading);
  void look_back();
  void judge_again(std::uint64_t i);
  void confirm(std::uint64_t i);
  bool has_neighbours(std::uint64_t i) const;
  Interpolator::Neighbours neighbours(std::uint64_t i) const;
  Interpolator::Values likely(std::uint64_t i) const;
  double departure(std::uint64_t i) const;
  void replace(Reading& reading, const Interpolator::Values& likely);
  void revise(std::uint64_t i);
  bool is_open(std::uint64_t i) const { return at(i).suspect && !at(i).replaced; }
  /// Index of the last reading at or before t, or the first one.
  std::uint64_t before(HostStamp t) const;
  Reading interpolated(std::uint64_t i, HostStamp t) const;
  /// Calls visit(r0, r1, dt) for the pieces of [t0, t1].
  template <class F>
  void pieces(HostStamp t0, HostStamp t1, F&& visit) const;

  std::array<Reading, kCapacity> readings_;
  std::uint64_t count_ = 0;
  ReadingPeriod period_;
  bool after_gap_ = false;
  SpikeJudge judge_;
  Interpolator interpolator_;
  std::array<double, 5> departures_{};  // of the last readings between four others, the newest last; negative: none
  std::optional<HostStamp> revised_;
  Counts counts_;
  bool has_aside_ = false;
  Reading aside_;  // far ahead of the others, not confirmed
};

}  // namespace epiline
