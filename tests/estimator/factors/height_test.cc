// Its gradient: gradient_test.cc. Derivation: docs/derivations/height.md.
#include "estimator/factors/height.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "estimator/geometry/so3.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/height_readings.h"
#include "tests/estimator/inertial/random_interval.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A drone that leans by 30 degrees, 10 m above the ground: its beam, mounted off the centre, is longer than 10 m.
TEST(HeightFactor, TheEndOfALeaningBeamLiesOnTheGround) {
  const Vec3 place(0.1, 0.05, -0.02), beam = -Vec3::UnitZ();
  NavState x;
  x.p = Vec3(3, 4, 10);
  x.R = so3_exp(Vec3(0, 0, 0.4)) * so3_exp(Vec3(0.5, 0, 0));
  const double lens_height = x.p.z() + (x.R * place).z(), distance = lens_height / std::cos(0.5);
  EXPECT_NEAR(height_offset({true, 1, 0, place + distance * beam, 0}, x), 0, 1e-12);
  EXPECT_GT(distance, 11);
}

/// A window of made-up readings of one barometer, and the factor of their covariance written out in full.
struct WrittenOut {
  std::unique_ptr<Window> window = std::make_unique<Window>(kMaxFrames);
  std::vector<int> frames;  ///< with a reading

  explicit WrittenOut(Random& random, int size) {
    window->height_sigmas_m[0] = 0.3;
    double walked = 0;
    for (int k = 0; k < size; ++k) {
      Slot& s = window->append();
      s.x = random_state(random);
      walked += 0.02 * random.gaussian(1).squaredNorm();
      s.heights[0] = {k == 0 || k == size - 1 || random.gaussian(1).x() > -0.5, 1, random.gaussian(1).x(), Vec3::Zero(),
                      walked};
      if (s.heights[0].has) frames.push_back(k);
    }
  }
  /// e' W e with the offset eliminated, over the readings from the i-th on.
  double cost_from(std::size_t i) const {
    const auto n = static_cast<Eigen::Index>(frames.size() - i);
    const auto reading = [&](Eigen::Index a) -> const Slot& {
      return window->at(frames[i + static_cast<std::size_t>(a)]);
    };
    MatrixXd C = 0.09 * MatrixXd::Identity(n, n);
    VectorXd e(n);
    for (Eigen::Index a = 0; a < n; ++a) {
      e[a] = height_offset(reading(a).heights[0], reading(a).x);
      for (Eigen::Index b = 0; b < n; ++b)
        C(a, b) += reading(std::min(a, b)).heights[0].walked_m2 - reading(0).heights[0].walked_m2;
    }
    const MatrixXd I = inverse(C);
    const VectorXd u = I * VectorXd::Ones(n);
    return e.dot(I * e) - std::pow(u.dot(e), 2) / u.sum();
  }
  double innovations_of(bool oldest_only) const {
    double sum = 0;
    each_innovation(*window, HeightKind::kBarometer, window->size(), [&](const HeightInnovation& i) {
      double r = 0;
      for (int j = 0; j < window->size(); ++j)
        r += i.share[static_cast<std::size_t>(j)] * height_offset(window->at(j).heights[0], window->at(j).x);
      if (!oldest_only || i.frame == 0) sum += r * r / i.variance;
    });
    return sum;
  }
};

RC_GTEST_PROP(HeightFactor, InnovationsSayWhatTheReadingsSayOfAnUnknownOffset, (std::uint32_t seed)) {
  Random random(seed);
  const WrittenOut w(random, 2 + static_cast<int>(seed % 10));
  const double all = w.cost_from(0);
  RC_ASSERT(std::abs(w.innovations_of(false) - all) < 1e-8 * (1 + all));
}

// What frame 0 hands to the prior is what it adds to the others.
RC_GTEST_PROP(HeightFactor, TheOldestInnovationIsWhatItsReadingAdds, (std::uint32_t seed)) {
  Random random(seed);
  const WrittenOut w(random, 3 + static_cast<int>(seed % 10));
  const double added = w.cost_from(0) - w.cost_from(1);
  RC_ASSERT(std::abs(w.innovations_of(true) - added) < 1e-8 * (1 + w.cost_from(0)));
}

RC_GTEST_PROP(HeightFactor, DifferencesAlone, (std::uint32_t seed)) {
  Random random(seed);
  const WrittenOut w(random, 2 + static_cast<int>(seed % 10));
  each_innovation(*w.window, HeightKind::kBarometer, w.window->size(), [&](const HeightInnovation& i) {
    double sum = 0;
    for (const double share : i.share) sum += share;
    RC_ASSERT(std::abs(sum) < 1e-12);
    RC_ASSERT(i.variance > 0.09);
  });
}

TEST(HeightFactor, AJumpBetweenTwoSeriesCostsNothing) {
  const SyntheticWindow s = make_window({.state_error = 0});
  Window& w = *s.window;
  w.height_sigmas_m[0] = 0.1;
  for (int k = 0; k < w.size(); ++k)
    w.at(k).heights[0] = {true, k < 4 ? 1U : 2U, w.at(k).x.p.z() + (k < 4 ? 0 : 5.0), Vec3::Zero(), 0};
  EXPECT_NEAR(add_height(w, {w.size(), false}, nullptr), 0, 1e-20);
  for (int k = 0; k < w.size(); ++k) w.at(k).heights[0].series = 1;
  EXPECT_GT(add_height(w, {w.size(), false}, nullptr), 9);
}

TEST(HeightFactor, OneReadingAloneSaysNothing) {
  const SyntheticWindow s = make_window({});
  s.window->height_sigmas_m[0] = 0.1;
  s.window->at(2).heights[0] = {true, 1, 5, Vec3::Zero(), 0};
  EXPECT_EQ(add_height(*s.window, {s.window->size(), false}, nullptr), 0);
}

}  // namespace
}  // namespace epiline::test
