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

/// The last few seconds of IMU samples (B, SI units), and their integration between any two instants.
class ImuHistory {
 public:
  enum class Push : std::uint8_t {
    kTaken,
    kOutOfOrder,
    kDuplicate,  ///< the stamp of the newest one, or a new stamp and the same six values though others never repeat
    kNotFinite,
    kImpossible,  ///< left out: a value that no sensor measures (is_impossible)
    kFarAhead,    ///< held: used together with the next sample if that confirms its timestamp
  };
  struct Reading {
    HostStamp stamp;
    Vec3 w, a;                      ///< rad/s, m/s^2, in B
    bool distrusted = false;        ///< saturated or stuck: treated as missing
    bool suspect = false;           ///< unlike its known neighbours: an interpolated value replaces it
    bool replaced = false;          ///< a suspect whose corrupt axes were replaced by likely values
    bool in_gap = false;            ///< one of too many suspects in a row: treated as missing
    bool lost = false;              ///< a suspect that stands for a sample that did not come, was refused, or repeated
    SpikeJudge::Unknown unknown{};  ///< of a suspect
  };
  struct Counts {
    std::uint64_t suspects = 0;  ///< samples unlike the previous ones
    std::uint64_t bridged = 0;   ///< samples unlike both neighbours, or repeated several times: corrupt, replaced
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
  /// While the newest sample is a suspect, it holds the values of the previous one.
  Reading newest() const { return value(count_ - 1); }
  bool newest_is_suspect() const { return count_ > 0 && at(count_ - 1).suspect; }
  const Counts& counts() const { return counts_; }
  /// The time after which integrals have changed since the last call, because a verdict on samples became final; empty
  /// if none did.
  std::optional<HostStamp> take_revised();
  /// True if corrupt samples come several times a second.
  bool spikes_persist() const { return judge_.persists(); }
  HostStamp oldest_stamp() const { return at(first()).stamp; }
  /// Usual interval between samples, s; 0 before the second one.
  double period() const { return period_.seconds(); }
  /// True if the newest sample came after a gap of more than 2.5 periods, or ended a burst of suspects too long to
  /// replace.
  bool after_gap() const { return after_gap_; }

  /// Longest time without a trusted sample between t0 and t1, s.
  double longest_unknown_s(HostStamp t0, HostStamp t1) const;
  /// True if the newest sample is at most one gap length before t.
  bool reaches(HostStamp t) const;

  /// Preintegrates from t0 to t1 at the biases and scales set in `out`. Samples are interpolated at both ends; beyond
  /// the newest sample its values are held. False, with `out` unchanged, if and only if the samples end more than half
  /// a second before t1 or begin more than half a second after t0.
  bool integrate(HostStamp t0, HostStamp t1, const Density& density, Preintegration& out) const;
  /// The state predicted from t0 to t1, without covariance; `omega`: angular rate at t1 plus the bias, rad/s.
  void propagate(HostStamp t0, HostStamp t1, const ImuScale& scale, NavState& x, Vec3& omega) const;
  /// Length of the mean of w - b_g over the samples from t0 to t1, rad/s: of shaking, nothing is left.
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
  void keep_place(HostStamp stamp, int in_a_row);
  bool keep_places(HostStamp next);
  bool repeats(const Reading& reading);
  void append(const Reading& reading);
  void judge(Reading& reading, bool unknown_before);
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
  Vec3 last_w_ = Vec3::Zero(), last_a_ = Vec3::Zero();
  int all_differed_ = 0, repeated_ = 0;  // readings in a row
  bool has_aside_ = false;
  Reading aside_;  // far ahead of the others, not confirmed
};

}  // namespace epiline
