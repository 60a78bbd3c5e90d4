// Views of a second camera in the track factor. Derivation: docs/derivations/several_cameras.md; its slopes:
// tests/estimator/factors/gradient_test.cc; the covariance of both cameras' errors: drift_test.cc.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "estimator/factors/kernels.h"
#include "estimator/factors/track.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/factors/explicit_residuals.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

VisualSettings settings(TrackNoiseModel noise = TrackNoiseModel::kDrift) {
  VisualSettings s = smooth_settings();
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

void expect_close(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  EXPECT_LT(relative_difference(a, b), 1e-9);  // other tracks may share their batches
}

TEST(SeveralCameras, ExactViewsOfBothFitAtTheTruth) {
  SyntheticWindow s = make_window({.pixel_noise = 0, .state_error = 0, .second = true});
  Window& w = *s.window;
  const auto both = system_of(w);
  EXPECT_LT(both->cost, 1e-9);
  w.rig.poses[1].p_CD.x() += 0.01;
  EXPECT_GT(system_of(w)->cost, 1) << "another rig does not fit";
  w.rig.use[1] = false;
  EXPECT_GT(both->residuals, 1.5 * system_of(w)->residuals);
}

/// Nothing triggers them together: the second one's views are of another time, turned to the stamp by the gyroscope.
TEST(SeveralCameras, ViewsOfAnotherTimeFitWhereTheirCameraWasThen) {
  SyntheticWindow s =
      make_window({.pixel_noise = 0, .state_error = 0, .second = true, .second_later = 0.016, .alone = true});
  const auto cost = [&](bool rows) {
    VisualSettings at = settings();
    at.rows = rows;
    return system_of(*s.window, at)->cost;
  };
  EXPECT_GT(cost(false), 10);
  EXPECT_LT(cost(true), 1e-3 * cost(false)) << "what the acceleration does within 16 ms is left";
}

TEST(SeveralCameras, ViewsOfTheStampAreTheSameWithTimesOfTheirOwn) {
  SyntheticWindow s = make_window({.second = true, .alone = true});
  VisualSettings timed = settings();
  timed.rows = true;
  EXPECT_EQ(dense(*system_of(*s.window, timed), s.window->size()), dense(*system_of(*s.window), s.window->size()));
}

/// Of one camera that moves, nothing but the IMU tells how far; two of them see it.
TEST(SeveralCameras, TwoCamerasSeeTheScale) {
  SyntheticWindow s = make_window({.pixel_noise = 0, .lever = 0, .state_error = 0, .second = true});
  Window& w = *s.window;
  Eigen::VectorXd larger = Eigen::VectorXd::Zero(6 * w.size() + kCameraCalibration);
  for (int k = 0; k < w.size(); ++k) larger.segment<3>(6 * k) = w.at(k).x.p - w.at(0).x.p;
  const auto curvature = [&] { return congruence(dense(*system_of(w), w.size()), larger)(0, 0); };
  const double both = curvature();
  w.rig.use[1] = false;
  EXPECT_LT(curvature(), 1e-3 * both);
}

TEST(SeveralCameras, WithoutViewsOfTheSecondNothingChanges) {
  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  const auto alone = system_of(w);
  w.rig = synthetic_rig();
  EXPECT_EQ(dense(*system_of(w), w.size()), dense(*alone, w.size()));
}

TEST(SeveralCameras, IndependentViewsAreOfTheFirstCameraAlone) {
  SyntheticWindow s = make_window({.second = true});
  Window& w = *s.window;
  const auto both = system_of(w, settings(TrackNoiseModel::kWhite));
  w.rig.use[1] = false;
  EXPECT_EQ(dense(*both, w.size()), dense(*system_of(w, settings(TrackNoiseModel::kWhite)), w.size()));
}

/// Another match is another error.
TEST(SeveralCameras, ViewsBeforeANewMatchAreLeftOut) {
  SyntheticWindow s = make_window({.second = true, .found_anew = 3});
  Window& w = *s.window;
  const auto anew = system_of(w);
  for (int i = 0; i < w.track_count(); ++i)
    for (int k = 0; k < 3; ++k) w.track(i).second &= ~w.bit(k);
  EXPECT_EQ(dense(*anew, w.size()), dense(*system_of(w), w.size()));
}

std::unique_ptr<VisualSystem> news_of(Window& w) {
  TrackFactor factor(best_instruction_set());
  auto system = std::make_unique<VisualSystem>();
  factor.collect(w, settings());
  factor.marginalise_oldest(w, settings(), *system);
  return system;
}

/// The blocks of the first `frames` poses and the time offset, which do not depend on where the first camera is.
Eigen::MatrixXd poses_and_time(const VisualSystem& s, int frames) {
  const int n = 6 * frames + 1;
  Eigen::MatrixXd all(n, n + 1);
  all << dense(s, frames).topLeftCorner(n, n), dense_rhs(s, frames).head(n);
  return all;
}

/// The same bearings, of one camera that is mounted where the second one is.
TEST(SeveralCameras, WhatTheSecondAloneSeesIsWhatACameraThereWouldSee) {
  SyntheticWindow rig = make_window({.second = true, .alone = true, .only_alone = true});
  SyntheticWindow moved = make_window({.only_alone = true, .moved = true});
  Window &a = *rig.window, &b = *moved.window;
  ASSERT_EQ(a.track_count(), 15);
  const auto alone = system_of(a), there = system_of(b);
  EXPECT_GT(alone->residuals, 100);
  EXPECT_EQ(alone->residuals, there->residuals);
  EXPECT_NEAR(alone->cost, there->cost, 1e-9 * there->cost);
  expect_close(poses_and_time(*alone, a.size()), poses_and_time(*there, b.size()));
  expect_close(poses_and_time(*news_of(a), a.size() - 1), poses_and_time(*news_of(b), b.size() - 1));
}

/// Batches of both kinds beside each other, and none of a lane of the other kind.
TEST(SeveralCameras, TracksOfEitherCameraAddUp) {
  SyntheticWindow s = make_window({.frames = 12, .tracks = 150, .second = true, .alone = true});
  Window& w = *s.window;
  const auto only = [&](bool by_second, bool by_first) {
    for (int i = 0; i < w.track_count(); ++i) w.track(i).in_use = w.track(i).camera > 0 ? by_second : by_first;
  };
  const int n = w.size();
  const auto check = [&](auto&& system, int frames) {
    only(true, true);
    const Eigen::MatrixXd both = dense(*system(w), frames);
    only(true, false);
    const Eigen::MatrixXd by_second = dense(*system(w), frames);
    only(false, true);
    const Eigen::MatrixXd by_first = dense(*system(w), frames);
    EXPECT_GT(by_second.norm(), 1);
    EXPECT_LT(relative_difference(by_first + by_second, both), 1e-11);
  };
  check([](Window& window) { return system_of(window); }, n);
  check([](Window& window) { return news_of(window); }, n - 1);
}

TEST(SeveralCameras, TracksOfTheSecondAloneNeedARigAndADrift) {
  SyntheticWindow s = make_window({.second = true, .alone = true});
  Window& w = *s.window;
  const auto tracks = [&](TrackNoiseModel noise) { return system_of(w, settings(noise))->tracks; };
  const int drifting = tracks(TrackNoiseModel::kDrift), white = tracks(TrackNoiseModel::kWhite);
  for (int i = 0; i < w.track_count(); ++i) w.track(i).in_use = w.track(i).camera == 0;
  EXPECT_EQ(drifting - tracks(TrackNoiseModel::kDrift), 15);
  EXPECT_EQ(white, tracks(TrackNoiseModel::kWhite)) << "left out before, too";
  w.rig.use[1] = false;
  w.append();
  TrackedFrame frame;
  frame.others[0].alone.push_back(make_feature(first_track_of(1) | 99, Vec3(0, 0, 3), Vec2::Zero()));
  frame.features.push_back(make_feature(first_track_of(1) | 98, Vec3(0, 0, 3), Vec2::Zero()));
  w.observe(frame);
  EXPECT_EQ(w.find(first_track_of(1) | 99), -1);
  ASSERT_GE(w.find(first_track_of(1) | 98), 0) << "where there is one camera, ids are whatever they are";
  EXPECT_EQ(w.track(w.find(first_track_of(1) | 98)).camera, 0);
}

/// Camera 1 becomes camera c.
void renumber(Window& w, std::uint8_t c) {
  std::swap(w.rig.poses[1], w.rig.poses[c]);
  std::swap(w.rig.use[1], w.rig.use[c]);
  for (int i = 0; i < w.track_count(); ++i) {
    TrackRecord& t = w.track(i);
    if (t.camera == 1) t.camera = c;
    if (t.second_camera == 1) t.second_camera = c;
  }
}

/// The first camera becomes camera 1, camera 1 camera 3; what is the first one then sees nothing, from elsewhere.
void put_another_first(Window& w) {
  const RigPose other = {so3_exp(Vec3(0.3, -1.2, 0.5)), Vec3(-0.3, 0.2, 0.1)};  // of what was first
  const RigPose second = w.rig.poses[1];
  w.calibration.p_BC -= w.calibration.R_BC * other.R_CD.transpose() * other.p_CD;
  w.calibration.R_BC = w.calibration.R_BC * other.R_CD.transpose();
  w.rig.use = {true, true, false, true};
  w.rig.poses[1] = other;
  w.rig.poses[3] = {other.R_CD * second.R_CD, other.p_CD + other.R_CD * second.p_CD};
  for (int i = 0; i < w.track_count(); ++i) {
    w.track(i).camera = 1;
    w.track(i).second_camera = 3;
  }
}

TEST(SeveralCameras, ACamerasNumberSaysNothing) {
  for (const std::uint8_t c : {std::uint8_t{2}, std::uint8_t{3}}) {
    SyntheticWindow s = make_window({.tracks = 150, .second = true, .second_later = 0.01, .alone = true});
    Window& w = *s.window;
    VisualSettings at = settings();
    at.rows = true;
    const auto before = system_of(w, at), before_news = news_of(w);
    renumber(w, c);
    expect_close(dense(*system_of(w, at), w.size()), dense(*before, w.size()));
    expect_close(dense(*news_of(w), w.size() - 1), dense(*before_news, w.size() - 1));
  }
}

/// Two cameras that see the same need not be the first one and another.
TEST(SeveralCameras, ATrackOfAnyCameraMayHaveASecondOne) {
  SyntheticWindow s = make_window({.tracks = 100, .second = true});
  Window& w = *s.window;
  const auto before = system_of(w), before_news = news_of(w);
  put_another_first(w);
  const auto after = system_of(w);
  EXPECT_EQ(after->residuals, before->residuals);
  EXPECT_NEAR(after->cost, before->cost, 1e-9 * before->cost);
  expect_close(poses_and_time(*after, w.size()), poses_and_time(*before, w.size()));
  expect_close(poses_and_time(*news_of(w), w.size() - 1), poses_and_time(*before_news, w.size() - 1));
}

/// Each track gets a camera, and a second one behind it, whatever its bearings are.
TEST(SeveralCameras, TracksOfAllPairsOfCamerasAddUp) {
  SyntheticWindow s = make_window({.frames = 12, .tracks = 400, .second = true});
  Window& w = *s.window;
  w.rig.use = {true, true, true, true};
  w.rig.poses[2] = {so3_exp(Vec3(0, 0.1, 0)), Vec3(0.05, 0, 0)};
  w.rig.poses[3] = {so3_exp(Vec3(0.1, 0, 0)), Vec3(0, 0.05, 0)};
  constexpr std::array<std::array<std::uint8_t, 2>, kCameraPairs> kPairs = {
      {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}, {3, 0}}};
  const auto pair = [](int i) { return static_cast<std::size_t>(i) % std::size_t{kCameraPairs}; };
  for (int i = 0; i < w.track_count(); ++i) {
    TrackRecord& t = w.track(i);
    t.camera = kPairs[pair(i)][0];
    t.second_camera = t.second != 0 ? kPairs[pair(i)][1] : 0;
    if (t.second_camera == 0) t.second = 0;
  }
  const auto check = [&](auto&& system, int frames) {
    const auto of = [&](auto&& chosen) {
      for (int i = 0; i < w.track_count(); ++i) w.track(i).in_use = chosen(i);
      return dense(*system(w), frames);
    };
    const Eigen::MatrixXd all = of([](int) { return true; });
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(all.rows(), all.cols());
    for (std::size_t p = 0; p < kPairs.size(); ++p) {
      const Eigen::MatrixXd part = of([&](int i) { return pair(i) == p; });
      EXPECT_GT(part.norm(), 1) << p;
      sum += part;
    }
    EXPECT_LT(relative_difference(sum, all), 1e-11);
  };
  check([](Window& window) { return system_of(window); }, w.size());
  check([](Window& window) { return news_of(window); }, w.size() - 1);
}

TEST(SeveralCameras, ATrackKeepsTheSecondCameraThatHasViewsInTheWindow) {
  Window w(6);
  w.rig.use = {true, true, true, false};
  const auto show = [&](std::initializer_list<std::size_t> cameras) {
    w.append();
    TrackedFrame frame;
    frame.features.push_back(make_feature(7, Vec3(0, 0, 3), Vec2::Zero()));
    for (const std::size_t c : cameras)
      frame.others[c - 1].views.push_back(make_second_view(7, Vec3(0.1, 0, 3), Vec2::Zero()));
    w.observe(frame);
    return w.seen_by_second(w.track(0), w.size() - 1) ? w.track(0).second_camera : 0;
  };
  EXPECT_EQ(show({3}), 0) << "not in use";
  EXPECT_EQ(show({2}), 2);
  EXPECT_EQ(show({1, 2}), 2);
  EXPECT_EQ(show({1}), 0);
  w.remove(1);
  w.remove(1);
  EXPECT_EQ(show({1, 2}), 1) << "the views of camera 2 have left";
}

TEST(SeveralCameras, ImpossibleAndUnknownViewsAreLeftOut) {
  SyntheticWindow s = make_window({.tracks = 4, .second = true});
  Window& w = *s.window;
  w.append();
  TrackedFrame frame;
  frame.features.push_back(make_feature(0, Vec3(0, 0, 3), Vec2::Zero()));
  frame.others[0].views.push_back(make_second_view(0, Vec3(0.1, 0, 3), Vec2::Zero()));
  frame.others[0].views.back().bearing[1] = std::nan("");
  frame.others[0].views.push_back(make_second_view(1, Vec3(0.1, 0, 3), Vec2::Zero()));  // not in this frame's features
  frame.others[0].views.push_back(make_second_view(4711, Vec3(0.1, 0, 3), Vec2::Zero()));  // of no track
  EXPECT_EQ(w.observe(frame).impossible, 1);
  for (int i = 0; i < w.track_count(); ++i) EXPECT_FALSE(w.seen_by_second(w.track(i), w.size() - 1)) << i;
}

}  // namespace
}  // namespace epiline::test
