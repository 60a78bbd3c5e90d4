#include <algorithm>
#include <limits>

#include "estimator/impl.h"

namespace epiline {

namespace {
constexpr double kContradicted = 0.1;  // share of the tracks that do not fit: on most right flights a hundredth
constexpr double kCostly = 1.2;        // times the cost a track at the image before, and without the cause
constexpr double kExplained = 0.75;    // of what refused readings save in cost, by slipped stamps
}  // namespace

/// Whether nearly all tracks fit the motion, to which the last solve has come.
bool Estimator::Impl::agree(const SolverSummary& s) const {
  const TrackFit fit = visual->track_fit();
  return fit.tracks - fit.fits <= kContradicted * s.tracks;
}

/// The window's cost if the stamps of the newest frame, and of all that follow, are late by so much more.
double Estimator::Impl::cost_if_slipped(double by_s, Supervisor& supervisor, const Supervisor::Effort& effort) {
  Slot& newest = window.newest();
  const Slot kept = newest;
  window.slip(by_s);
  if (history.reaches(imu_time(newest.image_stamp)) && !predict(window.at(window.size() - 2), newest)) newest = kept;
  const SolverSummary s = solve(supervisor, effort);
  solver.take_back(window);
  newest = kept;
  window.slip(-by_s);
  return s.solved() ? s.cost : std::numeric_limits<double>::infinity();
}

/// What the images contradict all at once, but not each other, are the newest readings, or the camera's stamps. What
/// they contradict for other reasons is left as it is. False: the stamps have slipped; the newest frame is gone, and
/// the next one is where it should be.
bool Estimator::Impl::explain(bool moved, SolverSummary& s, Supervisor& supervisor, const Supervisor::Effort& effort) {
  const double cost = s.cost;
  solver.take_back(window);
  double slip_s = 0, if_slipped = cost;
  for (const double by_s : {door.period_s, -door.period_s}) {
    if (!moved) break;  // stamps say nothing
    const double then = cost_if_slipped(by_s, supervisor, effort);
    if (then >= if_slipped) continue;
    slip_s = by_s;
    if_slipped = then;
  }
  Slot& newest = window.newest();
  const Slot kept = newest;
  newest.refused = true;
  if (predict(window.at(window.size() - 2), newest)) {
    s = solve(supervisor, effort);
    if (s.solved() && agree(s) && cost > kCostly * s.cost) {
      numbers.forget_turns();
      if (cost - if_slipped < kExplained * (cost - s.cost)) return true;
      solver.take_back(window);
      window.slip(slip_s);
      window.remove(window.size() - 1);
      window.prune();
      flight.cost = 0;
      return false;
    }
    solver.take_back(window);
  }
  newest = kept;
  s = solve(supervisor, effort);
  return true;
}

/// A solved window against what the images see; `moved`: at the frame before. False: as explain().
bool Estimator::Impl::doubt(bool moved, SolverSummary& s, Supervisor& supervisor, const Supervisor::Effort& effort) {
  const bool at_once = flight.cost > 0 && s.cost > kCostly * flight.cost * s.tracks;
  // What leaves a rest contradicts the rest. Of what moves, a step may hide how much contradicted.
  const auto contradict = [&] { return (moved && s.gated > kContradicted * s.tracks) || !agree(s); };
  if (at_once && !window.newest().silent && contradict() && !explain(moved, s, supervisor, effort)) return false;
  flight.cost = s.solved() && s.tracks > 0 ? s.cost / s.tracks : 0;
  if (!s.solved()) return true;
  const Intervals::Doubt doubt = intervals.doubt_contradicted();
  if (doubt.forces && !window.newest().at_rest) flight.after_refusal_s = kGateFree_s;
  if (doubt.forces || doubt.bias) s = solve(supervisor, effort);
  return true;
}

}  // namespace epiline
