#pragma once
// By how much images and IMU contradict each other. docs/derivations/turns.md, "Contradictions".
#include <algorithm>
#include <limits>

#include "estimator/factors/visual.h"
#include "estimator/statistics.h"

namespace epiline {

/// A figure that any solved window has, and that is large where numbers are wrong.
class Contradiction {
 public:
  struct Rule {
    double suspect, gross;         ///< beyond
    double most;                   ///< a window can't say more
    double remembered;             ///< of the figure, by the next flight
    double believed_s, refuted_s;  ///< until the figure follows what is seen, if that is more, and if it is less
  };
  constexpr explicit Contradiction(const Rule& rule) : rule_(rule) {}

  /// Seen in a window; `dt_s` since the one before, of which it moved for `moved_s`. It is soon believed. Only motion
  /// that fits refutes it, and later: at rest any calibration fits.
  void add(double seen, double dt_s, double moved_s) noexcept {
    seen = std::min(seen, rule_.most);
    const double share = seen < figure_ ? moved_s / (longer_ * rule_.refuted_s) : dt_s / rule_.believed_s;
    figure_ += std::min(1.0, share) * (seen - figure_);
    if (figure_ < 0.5 * rule_.suspect) longer_ = 1;
  }
  /// A new start may try again, but what contradicted before is not trusted yet: calibration is the rig's, not the
  /// start's. A gentle flight fits many a wrong number, so each one that a contradiction ended makes refuting take
  /// twice as long, up to half a minute, until it is refuted.
  void restart() noexcept {
    if (figure_ <= rule_.remembered) return;
    figure_ = rule_.remembered;
    longer_ = std::min(2 * longer_, kLongestRefuted_s / rule_.refuted_s);
  }
  void forget() noexcept { figure_ = 0, longer_ = 1; }
  double figure() const noexcept { return figure_; }
  Severity severity() const noexcept {
    return figure_ > rule_.gross ? Severity::kGross : figure_ > rule_.suspect ? Severity::kSuspect : Severity::kNone;
  }

 private:
  static constexpr double kLongestRefuted_s = 30;
  Rule rule_;
  double figure_ = 0, longer_ = 1;  ///< how much longer refuting takes
};

/// The three of them. What is remembered is suspect, not gross: gross would refuse the start.
class ContradictionWatch {
 public:
  /// `imu_chi2`: cost of the window's intervals of the IMU, over their numbers of motion. `settled`: the flight is.
  /// `parallax_px`: of the window.
  void add(const TrackFit& tracks, double imu_chi2, double dt_s, bool at_rest, double parallax_px,
           bool settled = true) noexcept {
    const double moved_s = at_rest ? 0 : dt_s * std::min(1., parallax_px / kMoves_px);
    misfit_px_.add(std::min(tracks.median_px, kFitsAll * tracks.quarter_px), dt_s, moved_s);
    if (worst() != Severity::kNone)
      contradicted_s_ += dt_s;
    else if (!at_rest && settled)
      fitted_s_ = std::min(kFittedMost_s, fitted_s_ + dt_s);
    if (at_rest) return;  // a hard landing stays in the window as long as the rest, and no depth is seen
    imu_chi2_.add(imu_chi2, dt_s, moved_s);
    const int deep = tracks.ahead + tracks.behind;
    if (deep >= kFewestDeep && deep >= kDeepShare * tracks.tracks)
      behind_.add(static_cast<double>(tracks.behind) / deep, dt_s, moved_s);
  }
  /// The next flight begins. What numbers have fitted, less what has contradicted them since, speaks for them still.
  void restart() noexcept {
    const bool fitted = numbers_fitted();
    for (Contradiction* c : {&misfit_px_, &imu_chi2_, &behind_}) fitted ? c->forget() : c->restart();
    fitted_s_ = fitted ? std::max(0., fitted_s_ - contradicted_s_) : 0;
    contradicted_s_ = 0;
  }
  /// Motion has fitted for so long that what contradicts now is no number of the rig: a blow, or something that moves.
  bool numbers_fitted() const noexcept { return fitted_s_ > kFitted_s; }
  /// False while they have fitted for so much longer than anything has contradicted since.
  bool may_accuse() const noexcept { return fitted_s_ - contradicted_s_ <= kFitted_s; }
  /// The noise that it was judged by is known to be another one.
  void forget_imu() noexcept { imu_chi2_.forget(); }
  const Contradiction& misfit_px() const noexcept { return misfit_px_; }  ///< of the tracks
  /// Squared standard deviations.
  const Contradiction& imu_chi2() const noexcept { return imu_chi2_; }
  const Contradiction& behind() const noexcept { return behind_; }  ///< share of the tracks that meet behind the camera
  Severity worst() const noexcept {
    return std::max({misfit_px_.severity(), imu_chi2_.severity(), behind_.severity()});
  }

 private:
  // Wrong numbers move all tracks: the best quarter misses by 0.4 to 0.7 times the median. What slides along edges, or
  // moves by itself, leaves a quarter as it is: 0.01 times.
  static constexpr double kFitsAll = 4;
  // Where little moves, tracks that are three times as noisy as assumed seem to have depths: a fifth of them, on either
  // side.
  static constexpr int kFewestDeep = 20;
  static constexpr double kDeepShare = 1. / 3;
  static constexpr double kMoves_px = 10;      // less refutes by as much less: a nudge fits any calibration, too
  static constexpr double kFitted_s = 3;       // a wrong sign shows itself within 2.5 s of motion
  static constexpr double kFittedMost_s = 30;  // what contradicts for longer may be a rig that was bent
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  // Of right flights it is 0.06 to 0.17 on the mean and 0.38 at most; with a lens not undistorted 1.5, with a wrong
  // sign of the accelerometer 6.
  Contradiction misfit_px_{
      {.suspect = 0.8, .gross = 2, .most = 10, .remembered = 1.5, .believed_s = 1, .refuted_s = 5}};
  // At most 1 on the mean if the noise densities are true, less because the states follow the noise. Right flights:
  // 0.27 at most, MH_01 0.6. Where the limit was set, with first-estimate Jacobians: MH_01 0.8; with a wrong sign of
  // the accelerometer 0.8 to 6, from the first pose on.
  Contradiction imu_chi2_{
      {.suspect = 0.9, .gross = kNever, .most = 2, .remembered = 1.5, .believed_s = 1, .refuted_s = 5}};
  // Of right flights at most 0.15 in a window, mostly 0; with the accelerometer reversed along the way 0.6 to 0.9. A
  // turn on the spot fits that sign, too, so what lies behind is refuted last.
  Contradiction behind_{
      {.suspect = 0.3, .gross = 0.5, .most = 1, .remembered = 0.5, .believed_s = 0.3, .refuted_s = 15}};
  double fitted_s_ = 0, contradicted_s_ = 0;
};

}  // namespace epiline
