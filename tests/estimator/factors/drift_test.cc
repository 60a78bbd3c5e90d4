// Tracks whose error drifts: the factor against the inverse of the views' whole covariance, and what marginalisation
// takes over. Its gradient: gradient_test.cc. Derivation: docs/derivations/drift.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "estimator/factors/track.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/factors/explicit_residuals.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kAlike = 1e9;  // degrees of freedom at which all weights are one

VisualSettings settings(double student) {
  VisualSettings s = test::smooth_settings();
  s.noise = TrackNoiseModel::kDrift;
  s.drift_sigma = 0.2;
  s.drift_inflation = 1.5;
  s.student = student;
  return s;
}

/// Views of different ages, as solved frames between images make them.
void give_ages(Window& w) {
  for (int i = 0; i < w.track_count(); ++i)
    for (int k = 0; k < w.size(); ++k) w.view(w.track(i), k).age = static_cast<float>(3 + i % 5 + 2 * k + k % 2);
}

/// One track's residuals (px) and their slopes written down: 2 numbers a view, in axes turned from view to view until
/// they agree best.
struct ExplicitDrift {
  const Window& w;
  const TrackRecord& t;
  std::vector<int> at;  ///< the frames that saw it
  std::vector<Mat23> chart;

  ExplicitDrift(const Window& window, const TrackRecord& track) : w(window), t(track) {
    Mat23 before;
    for (int k = 0; k < w.size(); ++k) {
      if (!w.seen(t, k)) continue;
      Mat23 J = chart_of(w.view(t, k));
      const Mat3 R = test::camera(w, k).R;
      if (!at.empty()) {
        const Eigen::Matrix2d product = J * R.transpose() * before.transpose();
        const double c = product(0, 0) + product(1, 1), s = product(0, 1) - product(1, 0), n = std::hypot(c, s);
        const Eigen::Matrix2d turn = (Eigen::Matrix2d() << c / n, -s / n, s / n, c / n).finished();
        J = turn * J;
      }
      before = J * R.transpose();
      chart.push_back(J);
      at.push_back(k);
    }
  }
  int views() const { return static_cast<int>(at.size()); }
  Vec2 residual(int i, const Vec3& P) const {
    const std::size_t n = static_cast<std::size_t>(i);
    const test::Camera camera = test::camera(w, at[n]);
    const Vec3 X = camera.R.transpose() * (P - camera.c);
    const Vec3 by_lens(X.x(), X.y(), (1 - w.calibration.focal) * X.z());
    return -chart[n] * by_lens / bearing_of(w.view(t, at[n])).dot(by_lens);
  }
  /// A random walk from the track's first image on; the first view errs by one step more than its age.
  MatrixXd covariance(double sigma) const {
    const int n = views();
    MatrixXd C(2 * n, 2 * n);
    const auto steps = [&](int i) { return 1 + static_cast<double>(w.view(t, at[static_cast<std::size_t>(i)]).age); };
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        C.block<2, 2>(2 * i, 2 * j) = sigma * sigma * std::min(steps(i), steps(j)) * Eigen::Matrix2d::Identity();
    return C;
  }
};

VectorXd residuals(const ExplicitDrift& e, const Vec3& P) {
  VectorXd r(2 * e.views());
  for (int i = 0; i < e.views(); ++i) r.segment<2>(2 * i) = e.residual(i, P);
  return r;
}

MatrixXd slopes_by_point(const ExplicitDrift& e, const Vec3& P) {
  MatrixXd K(2 * e.views(), 3);
  constexpr double h = 1e-5;
  for (int c = 0; c < 3; ++c)
    K.col(c) = (residuals(e, P + h * Vec3::Unit(c)) - residuals(e, P - h * Vec3::Unit(c))) / (2 * h);
  return K;
}

/// A window with one track of many views in use.
SyntheticWindow window_of_one_track() {
  SyntheticWindow s = make_window({.frames = 9, .tracks = 40, .pixel_noise = 0.3, .state_error = 1e-3});
  Window& w = *s.window;
  give_ages(w);
  int chosen = 0;
  for (int i = 0; i < w.track_count(); ++i) {
    w.track(i).in_use = false;
    if (w.views(w.track(i)) == w.size()) chosen = i;
  }
  w.track(chosen).in_use = true;
  return s;
}

TEST(Drift, IsTheInverseOfTheViewsWholeCovariance) {
  SyntheticWindow s = window_of_one_track();
  Window& w = *s.window;
  int chosen = 0;
  while (!w.track(chosen).in_use) ++chosen;
  const ExplicitDrift e(w, w.track(chosen));
  ASSERT_EQ(e.views(), w.size());
  for (const double student : {4.0, kAlike}) {
    const VisualSettings set = settings(student);
    const double sigma = set.drift_sigma * set.drift_inflation, unit = set.drift_inflation * set.drift_inflation;
    const MatrixXd I = test::inverse(e.covariance(sigma));
    const test::Camera first = test::camera(w, 0);
    Vec3 P = first.c + 4 * first.R * bearing_of(w.view(e.t, 0));
    for (int i = 0; i < 100; ++i) {
      const MatrixXd K = slopes_by_point(e, P);
      P -= test::solve(test::congruence(I, K), K.transpose() * (I * residuals(e, P)));
    }
    const MatrixXd K = slopes_by_point(e, P);
    const VectorXd r = residuals(e, P);
    MatrixXd J = MatrixXd::Zero(r.size(), 6 * w.size() + kCameraCalibration);
    for (int i = 0; i < e.views(); ++i)
      J.middleRows<2>(2 * i) =
          test::slopes<2>(w, w.size(), {e.at[static_cast<std::size_t>(i)]}, [&] { return e.residual(i, P); });
    const double dof = 2 * e.views() - 3, chi2 = r.dot(I * r), weight = (student + dof) / (student + chi2 * unit);
    const MatrixXd rest = I - test::congruence(test::inverse(test::congruence(I, K)), K.transpose() * I);
    const MatrixXd H = weight * test::congruence(rest, J);
    const VectorXd b = -weight * (J.transpose() * (rest * r));

    TrackFactor factor(best_instruction_set());
    const auto system = std::make_unique<VisualSystem>();
    factor.collect(w, set);
    factor.linearise(w, *system);
    EXPECT_LT(test::scaled_difference(test::dense(*system, w.size()), H), 1e-5);
    const VectorXd scale = test::units(H);
    EXPECT_LT((scale.asDiagonal() * (test::dense_rhs(*system, w.size()) - b)).cwiseAbs().maxCoeff(), 1e-5);
    EXPECT_NEAR(system->cost, (student + dof) / unit * std::log1p(chi2 * unit / student), 1e-6 * system->cost);
    EXPECT_NEAR(factor.cost(w), system->cost, 1e-9 * system->cost);
  }
}

/// What frame 0's views add given the others is what the others lack: the same walk, seen from the second view on.
TEST(Drift, MarginalisationInventsNoInformation) {
  SyntheticWindow s = make_window({.pixel_noise = 0, .state_error = 0});
  Window& w = *s.window;
  give_ages(w);
  const int frames = w.size() - 1;
  const auto added = std::make_unique<VisualSystem>(), system = std::make_unique<VisualSystem>();
  TrackFactor factor(best_instruction_set());
  factor.collect(w, settings(kAlike));
  factor.marginalise_oldest(w, settings(kAlike), *added);

  w.remove(w.size() - 1);  // the newest takes no part
  factor.collect(w, settings(kAlike));
  factor.linearise(w, *system);
  const MatrixXd with = test::dense(*system, frames);
  for (int i = 0; i < w.track_count(); ++i) w.track(i).mask &= ~w.bit(0);
  factor.collect(w, settings(kAlike));
  factor.linearise(w, *system);
  const MatrixXd without = test::dense(*system, frames);

  const MatrixXd H = test::dense(*added, frames);
  EXPECT_GT(H.norm(), 1);
  EXPECT_LT((H - (with - without)).norm(), 1e-6 * H.norm());
}

TEST(Drift, MarginalisationNeverTakesInformationAway) {
  for (const double motion : {0.0, 1e-4, 1.0, 10.0})
    for (const double noise : {0.0, 0.5, 20.0}) {
      SyntheticWindow s = make_window({.pixel_noise = noise, .motion = motion, .state_error = 3e-3 * (motion + 1e-3)});
      give_ages(*s.window);
      TrackFactor factor(best_instruction_set());
      const auto added = std::make_unique<VisualSystem>();
      factor.collect(*s.window, settings(4));
      factor.marginalise_oldest(*s.window, settings(4), *added);
      const MatrixXd H = test::dense(*added, s.window->size() - 1);
      ASSERT_TRUE(H.allFinite());
      EXPECT_GT(H.norm(), 1);
      EXPECT_GE(test::least_eigenvalue(H), -1e-9 * H.norm()) << "motion " << motion << ", noise " << noise << " px";
    }
}

/// A hole in a track hides how its error went on: what was seen before it is left out.
TEST(Drift, OfATrackWithAHoleOnlyTheNewestViewsCount) {
  SyntheticWindow s = window_of_one_track();
  Window& w = *s.window;
  int chosen = 0;
  while (!w.track(chosen).in_use) ++chosen;
  TrackFactor factor(best_instruction_set());
  const auto hole = std::make_unique<VisualSystem>(), late = std::make_unique<VisualSystem>();
  w.track(chosen).mask &= ~w.bit(2);
  factor.collect(w, settings(4));
  factor.linearise(w, *hole);
  for (int k = 0; k < 2; ++k) w.track(chosen).mask &= ~w.bit(k);
  factor.restart();
  factor.collect(w, settings(4));
  factor.linearise(w, *late);
  EXPECT_EQ(hole->residuals, 2 * (w.size() - 3) - 3);
  EXPECT_LT((test::dense(*hole, w.size()) - test::dense(*late, w.size())).norm(),
            1e-9 * test::dense(*late, w.size()).norm());
}

}  // namespace
}  // namespace epiline
