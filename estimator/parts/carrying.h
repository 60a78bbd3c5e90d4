#pragma once
// A state carried on by the readings, where no image is solved. Rules: docs/derivations/health.md.
#include "estimator/parts/common.h"
#include "estimator/parts/intervals.h"

namespace epiline {

class Carrying {
 public:
  Carrying(Common& common, const Intervals& intervals) : common_(common), intervals_(intervals) {}
  /// What is known of an instant; of one before all that is known: the state that follows it.
  KnownState to(HostStamp time) const {
    const KnownState& carried = common_.carried;
    return on_to(time < carried.time && carried.time == reached_ ? from_ : carried, time);
  }
  /// A state moved on to `time` by the readings. Without readings it stays where it is.
  KnownState on_to(const KnownState& from, HostStamp time) const;
  /// The window's newest frame, as the IMU predicts it.
  KnownState predicted_newest() const;
  /// What the covariance of a state claims because the calibration may be another one than was solved, by the state's
  /// covariance with that.
  StateCovariance doubt_of_calibration(const CrossCovariance& cross) const;
  /// A reading has come. While no frame is solved they would be overwritten before they are needed.
  void keep_up();

 private:
  void through(const Preintegration& interval, const Mat3& R_WB, KnownState& s) const;
  bool forces_are_unknown(const KnownState& from, HostStamp until) const;

  Common& common_;
  const Intervals& intervals_;
  KnownState from_;    ///< where the carried state last began: readings may be ahead of the images
  HostStamp reached_;  ///< the carried state that began there
};

/// Whether a carried state is good enough to begin a window with.
bool may_go_on(const KnownState& s);

}  // namespace epiline
