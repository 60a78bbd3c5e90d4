// Views of a second camera in the track factor. Derivation: docs/derivations/several_cameras.md; its slopes:
// tests/estimator/factors/gradient_test.cc.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <memory>

#include "estimator/factors/track.h"
#include "tests/estimator/factors/explicit_residuals.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

VisualSettings settings(TrackNoiseModel noise = TrackNoiseModel::kDrift) {
  VisualSettings s = test::smooth_settings();
  s.noise = noise;
  s.drift_sigma = 0.5;
  s.student = 1e9;  // all tracks alike
  return s;
}

std::unique_ptr<VisualSystem> system_of(const Window& w, const VisualSettings& s = settings()) {
  TrackFactor factor(best_instruction_set());
  auto system = std::make_unique<VisualSystem>();
  factor.collect(w, s);
  factor.linearise(w, *system);
  return system;
}

TEST(SeveralCameras, ExactViewsOfBothFitAtTheTruth) {
  SyntheticWindow s = make_window({.pixel_noise = 0, .state_error = 0, .second = true});
  Window& w = *s.window;
  const auto both = system_of(w);
  EXPECT_LT(both->cost, 1e-9);
  w.rig.p_CD.x() += 0.01;
  EXPECT_GT(system_of(w)->cost, 1) << "another rig does not fit";
  w.rig.use = false;
  EXPECT_GT(both->residuals, 1.5 * system_of(w)->residuals);
}

/// Of one camera that moves, nothing but the IMU tells how far; two of them see it.
TEST(SeveralCameras, TwoCamerasSeeTheScale) {
  SyntheticWindow s = make_window({.pixel_noise = 0, .lever = 0, .state_error = 0, .second = true});
  Window& w = *s.window;
  Eigen::VectorXd larger = Eigen::VectorXd::Zero(6 * w.size() + kCameraCalibration);
  for (int k = 0; k < w.size(); ++k) larger.segment<3>(6 * k) = w.at(k).x.p - w.at(0).x.p;
  const auto curvature = [&] { return larger.dot(test::dense(*system_of(w), w.size()) * larger); };
  const double both = curvature();
  w.rig.use = false;
  EXPECT_LT(curvature(), 1e-3 * both);
}

TEST(SeveralCameras, WithoutViewsOfTheSecondNothingChanges) {
  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  const auto alone = system_of(w);
  w.rig = synthetic_rig();
  EXPECT_EQ(test::dense(*system_of(w), w.size()), test::dense(*alone, w.size()));
}

TEST(SeveralCameras, IndependentViewsAreOfTheFirstCameraAlone) {
  SyntheticWindow s = make_window({.second = true});
  Window& w = *s.window;
  const auto both = system_of(w, settings(TrackNoiseModel::kWhite));
  w.rig.use = false;
  EXPECT_EQ(test::dense(*both, w.size()), test::dense(*system_of(w, settings(TrackNoiseModel::kWhite)), w.size()));
}

/// What the first camera's oldest views add, given all others; what the second one's add to those is left out.
TEST(SeveralCameras, MarginalisationInventsNoInformation) {
  for (const double noise : {0.0, 0.5}) {
    SyntheticWindow s = make_window({.pixel_noise = noise, .state_error = 0, .second = true});
    Window& w = *s.window;
    for (int i = 0; i < w.track_count(); ++i)
      for (int k = 0; k < w.size(); ++k) w.view(w.track(i), k).age = static_cast<float>(k);
    const int frames = w.size() - 1;
    TrackFactor factor(best_instruction_set());
    const auto added = std::make_unique<VisualSystem>();
    factor.collect(w, settings());
    factor.marginalise_oldest(w, settings(), *added);
    w.remove(w.size() - 1);  // the newest takes no part
    const Eigen::MatrixXd with = test::dense(*system_of(w), frames);
    for (int i = 0; i < w.track_count(); ++i) {
      w.track(i).mask &= ~w.bit(0);
      w.track(i).second &= ~w.bit(0);
    }
    const Eigen::MatrixXd rest = with - test::dense(*system_of(w), frames), H = test::dense(*added, frames);
    const auto least = [](const Eigen::MatrixXd& A) {
      return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues().minCoeff();
    };
    EXPECT_GT(H.trace(), 0.4 * rest.trace()) << "most of it is kept";
    EXPECT_GE(least(H), -1e-9 * H.norm());
    if (noise == 0) {
      EXPECT_GE(least(rest - H), -1e-6 * H.norm());
    }
  }
}

TEST(SeveralCameras, ImpossibleAndUnknownViewsAreLeftOut) {
  SyntheticWindow s = make_window({.tracks = 4, .second = true});
  Window& w = *s.window;
  w.append();
  TrackedFrame frame;
  frame.features.push_back(make_feature(0, Vec3(0, 0, 3), Vec2::Zero()));
  frame.second.push_back(make_second_view(0, Vec3(0.1, 0, 3), Vec2::Zero()));
  frame.second.back().bearing[1] = std::nan("");
  frame.second.push_back(make_second_view(1, Vec3(0.1, 0, 3), Vec2::Zero()));     // not in this frame's features
  frame.second.push_back(make_second_view(4711, Vec3(0.1, 0, 3), Vec2::Zero()));  // of no track
  EXPECT_EQ(w.observe(frame).impossible, 1);
  for (int i = 0; i < w.track_count(); ++i) EXPECT_FALSE(w.seen_by_second(w.track(i), w.size() - 1)) << i;
}

}  // namespace
}  // namespace epiline
