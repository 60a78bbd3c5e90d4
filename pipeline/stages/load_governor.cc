#include "pipeline/stages/load_governor.h"

#include <algorithm>

namespace epiline {

namespace {

struct Rung {
  LoadLevel level;
  int tracks;  ///< at most; 0: all
};
constexpr std::array kRungs = {Rung{LoadLevel::kFull, 0},
                               Rung{LoadLevel::kFewerFeatures, 240},
                               Rung{LoadLevel::kFewerFeatures, 190},
                               Rung{LoadLevel::kFewerFeatures, 150},
                               Rung{LoadLevel::kFewerFeatures, 120},
                               Rung{LoadLevel::kFewerFeatures, 100},
                               Rung{LoadLevel::kFewerFeatures, 80},
                               Rung{LoadLevel::kFewerIterations, 80},
                               Rung{LoadLevel::kFewerIterations, 60},
                               Rung{LoadLevel::kPredictionOnly, 0}};
constexpr int kLast = static_cast<int>(kRungs.size()) - 1;

const Rung& rung_at(int i) { return kRungs[static_cast<std::size_t>(i)]; }

// What a linearisation costs without any track, and what comes once a solve, in tracks; ten keyframes.
constexpr double kPerLinearisation = 120, kPerSolve = 90;
constexpr double kMostPlanned = 2;            // linearisations: a solve does without further ones when its time is up
constexpr double kRoom = 1.05, kSpare = 1.2;  // of the expected cost: to take a rung, to go up to it
constexpr int kCalmFrames = 5;
constexpr Span kLongestPrediction = Span::from_milliseconds(500);

}  // namespace

double RecentMost::get() const noexcept {
  double most = 0, second = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    second = std::max(second, std::min(most, values_[i]));
    most = std::max(most, values_[i]);
  }
  return count_ > 1 ? second : most;
}

LoadLevel LoadGovernor::level() const noexcept { return rung_at(rung_).level; }

namespace {
double work_of(int tracks, double linearisations) { return linearisations * (kPerLinearisation + tracks) + kPerSolve; }
}  // namespace

double LoadGovernor::cost_ns(int rung) const noexcept {
  const int tracks = rung_at(rung).tracks;
  const int used = tracks > 0 ? std::min(tracks, offered_) : offered_;
  const bool in_full = rung_at(rung).level < LoadLevel::kFewerIterations;
  return unit_ns_.get() * work_of(used, in_full ? std::clamp(linearisations_.get(), 1.0, kMostPlanned) : 1);
}

int LoadGovernor::first_that_fits(double budget_ns, double room) const noexcept {
  int rung = 0;
  while (rung < kLast && room * cost_ns(rung) > budget_ns) ++rung;
  return rung;
}

LoadGovernor::Plan LoadGovernor::plan_of(int rung) const noexcept {
  const Rung& r = rung_at(rung);
  const int steps = r.level == LoadLevel::kFewerIterations ? 1 : 0;
  return {r.level, {r.level != LoadLevel::kPredictionOnly, r.tracks, steps}};
}

/// Of prediction only: whether this frame is solved all the same.
bool LoadGovernor::let_through(HostStamp frame, bool saves) noexcept {
  const double cost = cost_ns(kLast - 1);
  if (saves) saved_ns_ = std::min(saved_ns_ + static_cast<double>(budget_ns_), cost);
  const bool paid = saves && saved_ns_ >= cost;
  if (!paid && any_solved_ && frame - last_solved_ < kLongestPrediction) return false;
  saved_ns_ = 0;
  return true;
}

LoadGovernor::Plan LoadGovernor::plan(HostStamp frame, std::int64_t budget_ns, bool saves) noexcept {
  budget_ns_ = budget_ns;
  const auto budget = static_cast<double>(budget_ns);
  const int before = rung_, fits = first_that_fits(budget, kRoom), better = first_that_fits(budget, kSpare);
  if (fits > rung_) {
    rung_ = fits;
    calm_ = 0;
  } else if (rung_ == kLast && better < kLast) {
    rung_ = kLast - 1;  // a single frame that came late takes no other's solve
    calm_ = 0;
  } else if (better < rung_) {
    calm_rung_ = calm_ > 0 ? std::max(calm_rung_, better) : better;
    if (++calm_ >= kCalmFrames) {
      rung_ = calm_rung_;
      calm_ = 0;
    }
  } else {
    calm_ = 0;
  }
  counts_.lowered += rung_ > before ? 1 : 0;
  counts_.raised += rung_ < before ? 1 : 0;
  ++counts_.frames[static_cast<std::size_t>(level())];

  Plan plan = plan_of(rung_);
  if (!plan.effort.solve && let_through(frame, saves)) {
    plan.effort = plan_of(kLast - 1).effort;
    ++counts_.let_through;
  }
  if (plan.effort.solve) {
    any_solved_ = true;
    last_solved_ = frame;
  }
  return plan;
}

void LoadGovernor::took(std::int64_t solve_ns, int offered, int used, int linearisations) noexcept {
  offered_ = offered;
  unit_ns_.add(static_cast<double>(solve_ns) / work_of(used, linearisations));
  linearisations_.add(linearisations);
  counts_.over_budget += solve_ns > budget_ns_ ? 1 : 0;
}

}  // namespace epiline
