// Flight and rest in turns, for two minutes, and for an hour in the night: whatever the estimator keeps stays bounded.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>

#include "estimator/monitor/contradiction.h"
#include "platform/log/suspicion_names.h"
#include "platform/memory/allocation_count.h"
#include "tests/estimator/estimator/life.h"
#include "tests/estimator/estimator/opened.h"

namespace epiline::test {
namespace {

/// Largest figures of a soak.
struct Soak {
  double interval_s = 0;  ///< of the IMU that knows the motion, between two frames of the window
  double sigma_v = 0, sigma_tilt = 0, sigmas = 0, at_s = 0;
  int frames = 0, tracking = 0, without = 0, wrong = 0;
  std::uint64_t resets = 0, heap_calls = 0;
  Suspicions suspicions;
};

void look(LifeRig& rig, Soak& soak) {
  const Odometry& o = rig.estimator().odometry();
  const Window& window = opened(rig.estimator()).window;
  for (int k = 1; k < window.size(); ++k)
    if (window.at(k).imu.knows_motion) soak.interval_s = std::max(soak.interval_s, window.at(k).imu.T);
  for (const std::size_t k : {6U, 7U, 8U}) soak.sigma_v = std::max(soak.sigma_v, std::sqrt(o.covariance[17 * k]));
  for (const std::size_t k : {3U, 4U}) soak.sigma_tilt = std::max(soak.sigma_tilt, std::sqrt(o.covariance[17 * k]));
  const LifeError e = worst_error(rig);
  soak.wrong += !(e.sigmas <= LifeVerdict::kSigmas);
  if (e.sigmas > soak.sigmas) soak.sigmas = e.sigmas, soak.at_s = rig.now();
}

/// Runs to `seconds`, along what was planned for the rig.
Soak run(LifeRig& rig, double seconds) {
  Soak soak;
  rig.run_to(seconds, [&](const StepResult& result) {
    ++soak.frames;
    soak.without += !result.has_pose && rig.now() > 3;
    soak.tracking += result.has_pose && rig.estimator().odometry().health.state == HealthState::kTracking;
    if (result.has_pose && rig.now() > 5) look(rig, soak);
  });
  soak.resets = rig.estimator().stats().resets;
  soak.heap_calls = rig.heap_calls();
  soak.suspicions = rig.estimator().stats().suspicions;
  return soak;
}

Row drifting() {
  Row row{};
  row[kNoise] = 1;
  return row;
}

/// Stands for 2 s, then flies and rests: each as long as chance wants, rests up to `longest_rest_s`.
Soak fly_and_rest(double seconds, double longest_rest_s) {
  LifeRig rig(drifting(), 1, true);
  std::mt19937 random(5);
  const auto between = [&](double from, double to) {
    return from + (to - from) * static_cast<double>(random() % 1000) / 1000;
  };
  for (double t = 2; t < seconds;) {
    rig.motion.change(t);
    rig.motion.change(t += between(5, 60));
    t += between(2, longest_rest_s);
  }
  return run(rig, seconds);
}

/// Stands for so long after it was switched on, and then flies for 10 s.
Soak wait_and_fly(double seconds, bool warms_up) {
  Row row = drifting();
  row[kWarming] = warms_up;
  LifeRig rig(row, 1, true);
  rig.motion.change(seconds);
  return run(rig, seconds + 10);
}

void expect_bounds(const Soak& soak) {
  EXPECT_LT(soak.interval_s, 5.2);
  EXPECT_LT(soak.sigma_v, 0.2);
  EXPECT_LT(soak.sigma_tilt, 0.02);
  EXPECT_EQ(soak.wrong, 0) << soak.sigmas << " sigma at " << soak.at_s << " s";
  EXPECT_EQ(soak.without, 0);
  EXPECT_GT(soak.tracking, 0.97 * soak.frames);
  EXPECT_EQ(soak.resets, 0u);
  if (allocation_counting_available()) {
    EXPECT_EQ(soak.heap_calls, 0u);
  }
  for (std::size_t i = 0; i < soak.suspicions.size(); ++i)
    EXPECT_LT(soak.suspicions[i].severity, Severity::kSuspect) << kSuspectNames[i] << ' ' << soak.suspicions[i].figure;
}

TEST(EstimatorSoak, TwoMinutesOfFlightAndRest) { expect_bounds(fly_and_rest(120, 20)); }

TEST(EstimatorSoak, AnHourOfFlightAndRest) {
  if (std::getenv("EPILINE_NIGHTLY") == nullptr) GTEST_SKIP() << "half a minute: for the night (EPILINE_NIGHTLY)";
  expect_bounds(fly_and_rest(3600, 300));
}

/// Of the velocity, in the two seconds after it left.
double largest_sigma_after_a_wait_of(double seconds) {
  LifeRig rig(drifting(), 1, true);
  rig.motion.change(seconds);
  double sigma = 0;
  rig.run_to(seconds + 2, [&](const StepResult& result) {
    if (!result.has_pose || rig.now() < seconds) return;
    for (const std::size_t k : {6U, 7U, 8U})
      sigma = std::max(sigma, std::sqrt(rig.estimator().odometry().covariance[17 * k]));
  });
  return sigma;
}

/// It depends on how long before the vehicle leaves the last image was solved, too: by a third.
double mean_sigma_after_a_wait_of(double seconds) {
  constexpr int kWaits = 8;
  double sum = 0;
  for (int i = 0; i < kWaits; ++i) sum += largest_sigma_after_a_wait_of(seconds + 0.1 * i);
  return sum / kWaits;
}

/// It hangs on the last frame at rest, not on one of seconds ago.
TEST(EstimatorSoak, AWaitDoesNotChangeHowWellItKnowsItsSpeedAsItLeaves) {
  const double after_three = mean_sigma_after_a_wait_of(3);
  for (const double seconds : {5.5, 7., 9., 11.5, 14., 30.})
    EXPECT_LT(mean_sigma_after_a_wait_of(seconds), 1.2 * after_three) << seconds;
}

/// It drives ahead, and images show that late: a departure that still counts as rest is taken for a bias, and noise of
/// the tracks for near points that stay where they are.
TEST(EstimatorSoak, KnowsItsSpeedWhenItLeavesSlowly) {
  struct Departure {
    double gather_s, most_sigmas;
  };
  for (const Departure& departure : {Departure{10, 1.5}, Departure{80, 3}})
    for (const View view : {kClean, kOwnParts})
      for (const unsigned seed : {1U, 2U, 3U}) {
        Row row{};
        row[kPath] = kRoad;
        row[kView] = view;
        LifeRig rig(row, seed, true);
        rig.motion.gather_s = departure.gather_s;
        rig.motion.change(4);
        double sigmas = 0;
        rig.run_to(4 + std::min(departure.gather_s, 30.), [&](const StepResult& result) {
          if (result.has_pose && rig.now() > 4) sigmas = std::max(sigmas, worst_error(rig).sigmas);
        });
        EXPECT_LT(sigmas, departure.most_sigmas) << departure.gather_s << " s, " << view << ' ' << seed;
      }
}

/// Drives at 15 m/s, cruises at 40 m/s or turns at 2 g. What is known of speed and scale may become less, not wrong.
TEST(EstimatorSoak, FliesFastForThreeMinutes) {
  for (const Path path : {kRoad, kCruise, kTurn}) {
    SCOPED_TRACE(path);
    Row row = drifting();
    row[kPath] = path;
    LifeRig rig(row, 1, true);
    rig.motion.change(2);
    const Soak soak = run(rig, 182);
    EXPECT_EQ(soak.wrong, 0) << soak.sigmas << " sigma at " << soak.at_s << " s";
    EXPECT_EQ(soak.without, 0);
    EXPECT_EQ(soak.resets, 0u);
    EXPECT_GT(soak.tracking, 0.97 * soak.frames);
  }
}

TEST(EstimatorSoak, LeavesAfterMinutes) {
  expect_bounds(wait_and_fly(60, false));
  SCOPED_TRACE("a gyroscope that warms up, whose bias is no scale");
  expect_bounds(wait_and_fly(200, true));
}

TEST(EstimatorSoak, LeavesAfterAnHour) {
  if (std::getenv("EPILINE_NIGHTLY") == nullptr) GTEST_SKIP() << "half a minute: for the night (EPILINE_NIGHTLY)";
  expect_bounds(wait_and_fly(400, true));
  expect_bounds(wait_and_fly(3600, false));
}

/// What contradicted once may be refuted later, after however many flights that it ended.
TEST(EstimatorSoak, AContradictionIsRefutedWithinAMinuteAfterTenFlightsThatItEnded) {
  ContradictionWatch watch;
  TrackFit wrong, right;
  wrong.median_px = wrong.quarter_px = 10;
  right.median_px = right.quarter_px = 0.1;
  for (int flight = 0; flight < 10; ++flight) {
    for (int i = 0; i < 100; ++i) watch.add(wrong, 0, 0.1, false, 10);
    watch.restart();
  }
  double seconds = 0;
  for (; watch.worst() != Severity::kNone && seconds < 1e4; seconds += 0.1) watch.add(right, 0, 0.1, false, 10);
  EXPECT_LT(seconds, 60);
}

}  // namespace
}  // namespace epiline::test
