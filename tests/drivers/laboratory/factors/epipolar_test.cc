// The epipolar factor against its residuals written down one by one, their Jacobians numerical. Derivation:
// docs/derivations/epipolar.md.
#include "drivers/laboratory/factors/epipolar.h"

#include <gtest/gtest.h>

#include "tests/estimator/factors/explicit_residuals.h"

namespace epiline::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VisualSettings epipolar_settings() {
  VisualSettings s;
  s.focal_px = kFocal;
  s.extrinsics = true;
  return s;
}

/// Every pair of views as the paper prints it.
class Printed {
 public:
  /// `oldest_only`: the pairs that contain frame 0.
  Printed(Window& w, int frames, bool oldest_only) : w_(w) {
    const int unknowns = 6 * frames + kCameraCalibration;
    H = MatrixXd::Zero(unknowns, unknowns);
    b = VectorXd::Zero(unknowns);
    for (int i = 0; i < w.track_count(); ++i) {
      const TrackRecord& t = w.track(i);
      const int before = pairs;
      for (int k = 0; k < (oldest_only ? 1 : frames); ++k)
        for (int l = k + 1; l < frames; ++l)
          if (counts(t, k) && counts(t, l)) add(t, k, l, frames);
      tracks += pairs > before;
    }
  }

  MatrixXd H;
  VectorXd b;
  double cost = 0;
  int tracks = 0, pairs = 0;

 private:
  Vec3 normalised(const TrackRecord& t, int k) const {
    return bearing_of(w_.view(t, k)) / bearing_of(w_.view(t, k)).z();
  }
  bool counts(const TrackRecord& t, int k) const {
    return t.in_use && w_.seen(t, k) && bearing_of(w_.view(t, k)).z() > 0.05;
  }

  void add(const TrackRecord& t, int i, int j, int frames) {
    ++pairs;
    if ((camera(w_, i).c - camera(w_, j).c).norm() == 0) return;
    const auto residual = [&] {
      const Camera from = camera(w_, i), to = camera(w_, j);
      const Vec3 z_i = normalised(t, i), z_j = normalised(t, j);
      const Vec3 n = (from.c - to.c).normalized();
      return VectorXd::Constant(1, kFocal / 1.5 * z_j.dot(to.R.transpose() * n.cross(from.R * z_i))).eval();
    };
    add_huber(slopes(w_, 1, frames, {i, j}, residual), residual(), H, b, cost);
  }

  Window& w_;
};

/// Tracks that begin and end anywhere, a few of them not in use; some bearings sideways, in frame 0 too.
SyntheticWindow ragged_window(double noise) {
  SyntheticWindow s = make_window({.frames = 7, .tracks = 60, .pixel_noise = noise, .state_error = 0.01});
  Window& w = *s.window;
  for (int i = 0; i < w.track_count(); ++i) {
    TrackRecord& t = w.track(i);
    for (int k = 0; k < i % 4; ++k) t.mask &= ~w.bit(k);
    for (int k = w.size() - i % 3; k < w.size(); ++k) t.mask &= ~w.bit(k);
    t.in_use = i % 10 != 7;
    if (i % 8 != 0) continue;
    Observation& aside = w.view(t, i % w.size());
    set_view(Vec3(0.999, 0, 0.04).normalized(), chart_of(aside), aside);
  }
  return s;
}

class EpipolarFactorOn : public testing::TestWithParam<InstructionSet> {
 protected:
  void SetUp() override {
    if (!runs_here(GetParam())) GTEST_SKIP() << name_of(GetParam()) << " is not on this machine";
  }
  const std::unique_ptr<VisualSystem> system_ = std::make_unique<VisualSystem>();
};

void expect_same(const VisualSystem& system, const Printed& printed, int frames) {
  EXPECT_NEAR(system.cost, printed.cost, 1e-10 * printed.cost);
  EXPECT_LT(scaled_difference(dense(system, frames), printed.H), 1e-6);
  EXPECT_LT(scaled_difference(dense_rhs(system, frames), printed.b, printed.H), 1e-7);
}

/// Good and wild bearings (Huber's weights), the clock off.
TEST_P(EpipolarFactorOn, TheSumsAreThoseOfEveryPairAsPrinted) {
  for (const double noise : {0.5, 4.0}) {
    SyntheticWindow s = ragged_window(noise);
    Window& w = *s.window;
    w.calibration.time_offset = 2e-3;
    EpipolarFactor factor(GetParam());
    factor.collect(w, epipolar_settings());
    factor.linearise(w, *system_);
    const Printed all(w, w.size(), false);
    expect_same(*system_, all, w.size());
    EXPECT_EQ(system_->tracks, all.tracks);
    EXPECT_EQ(system_->residuals, all.pairs);
    EXPECT_NEAR(factor.cost(w), all.cost, 1e-10 * all.cost);
  }
}

/// Of the window as it was collected, and of one that has lost a frame since.
TEST_P(EpipolarFactorOn, TheOldestFrameLeavesItsPairs) {
  SyntheticWindow s = ragged_window(1);
  Window& w = *s.window;
  EpipolarFactor factor(GetParam());
  factor.collect(w, epipolar_settings());
  factor.marginalise_oldest(w, epipolar_settings(), *system_);
  expect_same(*system_, Printed(w, w.size() - 1, true), w.size() - 1);
  w.remove(1);
  factor.marginalise_oldest(w, epipolar_settings(), *system_);
  expect_same(*system_, Printed(w, w.size() - 1, true), w.size() - 1);
}

TEST_P(EpipolarFactorOn, TwoCamerasInOnePlaceSayNothing) {
  SyntheticWindow s = ragged_window(1);
  Window& w = *s.window;
  w.at(3).x = w.at(2).x;
  EpipolarFactor factor(GetParam());
  factor.collect(w, epipolar_settings());
  factor.linearise(w, *system_);
  const Printed all(w, w.size(), false);
  expect_same(*system_, all, w.size());
  EXPECT_NEAR(factor.cost(w), all.cost, 1e-10 * all.cost);
  EXPECT_TRUE((Eigen::Map<Eigen::Matrix<double, 6, 6>>(system_->H[2][3]).isZero(0)));
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, EpipolarFactorOn, testing::ValuesIn(kInstructionSets),
                         [](const auto& set) { return name_of(set.param); });

}  // namespace
}  // namespace epiline::test
