// The track factor's scale and points; its instruction sets against each other. Their gradients and what
// they leave open: gradient_test.cc. Derivation: docs/derivations/track.md.
#include <gtest/gtest.h>

#include "estimator/factors/track.h"
#include "tests/estimator/any_factor.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

/// The same images of a larger world ask for nothing, also where they show no depth: a vehicle that stands for long
/// would leave its scale to their noise.
TEST(TrackFactor, LeavesScaleUnobservable) {
  for (const TrackNoiseModel noise : {TrackNoiseModel::kWhite, TrackNoiseModel::kDrift})
    for (const InstructionSet set : sets_here())
      for (const double motion : {1e-5, 1e-4, 1e-3, 1.}) {
        SyntheticWindow s = make_window({.motion = motion, .lever = 0, .state_error = 0});
        Window& w = *s.window;
        VisualSettings settings;
        settings.noise = noise;
        auto system = std::make_unique<VisualSystem>();
        TrackFactor factor(set);
        factor.collect(w, settings);
        factor.linearise(w, *system);
        double pull = 0, size = 0;
        for (int k = 0; k < w.size(); ++k) {
          const Eigen::Map<const Vec3> b(system->b[k]);
          pull += b.dot(w.at(k).x.p);
          size += b.norm() * (w.at(k).x.p - w.newest().x.p).norm();
        }
        EXPECT_LT(std::abs(pull), 1e-3 * size + 2e-3) << name_of(set) << ", " << motion << " m";
      }
}

/// What the tracks say of the scale, as a standard deviation.
double sigma_of_scale(const Window& w, TrackNoiseModel noise, bool rows, InstructionSet set) {
  VisualSettings settings;
  settings.noise = noise;
  settings.rows = rows;
  auto system = std::make_unique<VisualSystem>();
  TrackFactor factor(set);
  factor.collect(w, settings);
  factor.linearise(w, *system);
  const auto from_newest = [&](int k) -> Vec3 { return w.at(k).x.p - w.newest().x.p; };
  using Block = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>;
  double curvature = 0;  // along a larger world
  for (int k = 0; k < w.size(); ++k)
    for (int l = k; l < w.size(); ++l)
      curvature += (l > k ? 2 : 1) * from_newest(k).dot(Block(system->H[k][l]).topLeftCorner<3, 3>() * from_newest(l));
  return 1 / std::sqrt(std::abs(curvature));
}

/// Also where the time offset has moved since the frames were cut: the way to their exposure grows with the world, but
/// for what forces of 10 m/s^2 do to it. Of a way that is fixed in metres the scale would be known to 5 %.
TEST(TrackFactor, LeavesScaleUnobservableBesideAnotherTimeOffset) {
  for (const InstructionSet set : sets_here())
    for (const double offset : {0., 0.01, -0.01}) {
      SyntheticWindow s = make_window({.motion = 10, .lever = 0, .state_error = 0});
      s.window->calibration.time_offset = s.window->newest().time_offset_used = offset;
      EXPECT_GT(sigma_of_scale(*s.window, TrackNoiseModel::kWhite, false, set), 0.5)
          << name_of(set) << ", " << offset << " s";
    }
}

/// And where each row has its own time: of velocities in metres the scale would be known to 1 %.
TEST(TrackFactor, LeavesScaleUnobservableWithARollingShutter) {
  for (const TrackNoiseModel noise : {TrackNoiseModel::kWhite, TrackNoiseModel::kDrift})
    for (const InstructionSet set : sets_here()) {
      const SyntheticWindow s = make_window({.motion = 10, .lever = 0, .state_error = 0, .readout_s = 0.03});
      EXPECT_GT(sigma_of_scale(*s.window, noise, true, set), 10) << name_of(set);
    }
}

/// What the tracks say of the positions, 1/m^2 on the mean of all axes and frames, once they were collected twice.
double information_on_positions(TrackFactor& factor, const Window& w, TrackNoiseModel noise) {
  VisualSettings settings;
  settings.noise = noise;
  auto system = std::make_unique<VisualSystem>();
  for (int i = 0; i < 2; ++i) {
    factor.collect(w, settings);
    factor.linearise(w, *system);
  }
  double sum = 0;
  for (int k = 0; k < w.size(); ++k)
    for (int i = 0; i < 3; ++i) sum += system->H[k][k][7 * i];
  return sum / (3 * w.size());
}

/// Where views show no depth, noise would tell one, mostly a near one, and a near point that does not seem to move says
/// that the camera stands: a hundred times as surely as what is known to be as far as all that was seen before.
TEST(TrackFactor, TakesNoiseForNoNearness) {
  for (const TrackNoiseModel noise : {TrackNoiseModel::kWhite, TrackNoiseModel::kDrift})
    for (const InstructionSet set : sets_here()) {
      TrackFactor clear(set);
      const double known = information_on_positions(clear, *make_window({.state_error = 0}).window, noise);
      for (const double motion : {1e-4, 1e-3, 4e-3}) {
        const SyntheticWindow still = make_window({.motion = motion, .lever = 0, .state_error = 0});
        TrackFactor unseen(set);
        EXPECT_LT(information_on_positions(unseen, *still.window, noise), 1.5 * known) << name_of(set) << ' ' << motion;
        TrackFactor seen(set);
        information_on_positions(seen, *make_window({.state_error = 0}).window, noise);
        const double remembered = information_on_positions(seen, *still.window, noise);
        EXPECT_LT(remembered, 1.5 * known) << name_of(set) << ' ' << motion;
        EXPECT_GT(remembered, 0.3 * known) << name_of(set) << ' ' << motion;
      }
    }
}

/// Cameras that move the other way see the same lines, which then meet behind them.
TEST(TrackFactor, SaysOnWhichSideOfTheCamerasItsTracksMeet) {
  for (const TrackNoiseModel noise : {TrackNoiseModel::kWhite, TrackNoiseModel::kDrift})
    for (const InstructionSet set : sets_here()) {
      SyntheticWindow s = make_window({.lever = 0, .state_error = 0});
      Window& w = *s.window;
      VisualSettings settings;
      settings.noise = noise;
      auto system = std::make_unique<VisualSystem>();
      const auto fit = [&] {
        TrackFactor factor(set);
        factor.collect(w, settings);
        factor.linearise(w, *system);
        return factor.track_fit();
      };
      const TrackFit right = fit();
      EXPECT_GT(right.ahead, 50) << name_of(set);
      EXPECT_EQ(right.behind, 0) << name_of(set);
      for (int k = 0; k < w.size(); ++k) w.at(k).x.p = -w.at(k).x.p;
      const TrackFit reversed = fit();
      EXPECT_EQ(reversed.ahead, 0) << name_of(set);
      EXPECT_EQ(reversed.behind, right.ahead) << name_of(set);
      for (int k = 0; k < w.size(); ++k) w.at(k).x.p.setZero();
      const TrackFit still = fit();
      EXPECT_EQ(still.ahead + still.behind, 0) << name_of(set) << ": nothing shows a depth";
    }
}

/// The last step of a point is not taken but eliminated with the poses, and what it would gain is counted: the same
/// cost and equations as with points that have converged.
TEST(TrackFactor, EliminatesTheLastStepOfAPointInsteadOfTakingIt) {
  SyntheticWindow s = make_window({.pixel_noise = 0.5});
  Window& w = *s.window;
  VisualSettings settings = smooth_settings();
  settings.cauchy = 1000;  // weights that bend are taken where the point was, as the slopes are
  TrackFactor converged(best_instruction_set());
  const auto reference = std::make_unique<VisualSystem>(), system = std::make_unique<VisualSystem>();
  converged.collect(w, settings);
  converged.linearise(w, *reference);
  // GIVEN a factor whose points are where they were found before the poses moved a little
  settings.converged = VisualSettings{}.converged;
  TrackFactor factor(best_instruction_set());
  const std::vector<NavState> states = [&] {
    std::vector<NavState> all;
    for (int k = 0; k < w.size(); ++k) all.push_back(w.at(k).x);
    return all;
  }();
  for (int k = 0; k < w.size(); ++k) w.at(k).x.p += Vec3(1e-3, -5e-4, 5e-4) * std::cos(2.0 * k);
  factor.collect(w, settings);
  factor.linearise(w, *system);
  for (int k = 0; k < w.size(); ++k) w.at(k).x = states[static_cast<std::size_t>(k)];
  // WHEN it is linearised with the points as they are
  factor.linearise(w, *system);
  // THEN
  EXPECT_NEAR(system->cost, reference->cost, 1e-7 * reference->cost);
  EXPECT_NEAR(factor.cost(w), reference->cost, 1e-7 * reference->cost);
  for (int k = 0; k < w.size(); ++k)
    for (int i = 0; i < 6; ++i) {
      const double unit = std::sqrt(reference->H[k][k][7 * i]);  // in sigmas of this number given all others
      EXPECT_NEAR(system->b[k][i] / unit, reference->b[k][i] / unit, 1e-3) << "frame " << k << ", row " << i;
    }
}

TEST(TrackFactor, IsTheSameOnEveryInstructionSet) { expect_same_on_every_set<TrackFactor>(); }

// ---- bearings of an exact rolling shutter; derivation: docs/derivations/rolling_shutter.md ----

/// Sum of the squared residuals, in sigmas of 0.5 px, at the true states and without noise of the tracks.
double misfit(double readout_s, bool rows, TrackNoiseModel noise) {
  SyntheticWindow s = make_window({.pixel_noise = 0, .state_error = 0, .readout_s = readout_s});
  TrackFactor factor(best_instruction_set());
  VisualSettings settings = smooth_settings();
  settings.noise = noise;
  settings.drift_sigma = 0.5;
  settings.rows = rows;
  factor.collect(*s.window, settings);
  return factor.cost(*s.window);
}

class RollingShutterFactor : public testing::TestWithParam<TrackNoiseModel> {};

TEST_P(RollingShutterFactor, ExplainsWhatTheMiddleRowDoesNot) {
  const double middle_row = misfit(0.033, false, GetParam()), rows = misfit(0.033, true, GetParam());
  EXPECT_GT(middle_row, 10);
  EXPECT_LT(rows, 1e-3 * middle_row);  // what the acceleration does within an image is left
}

TEST_P(RollingShutterFactor, IsTheGlobalOneWhereAllRowsAreOfTheStamp) {
  EXPECT_EQ(misfit(0, true, GetParam()), misfit(0, false, GetParam()));
}

INSTANTIATE_TEST_SUITE_P(Noise, RollingShutterFactor,
                         testing::Values(TrackNoiseModel::kWhite, TrackNoiseModel::kDrift));

}  // namespace
}  // namespace epiline::test
