// Where the estimator begins anew after a reset: somewhere finite, on the right clock, once for each failure.
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/estimator/estimator/opened.h"
#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

bool is_finite(const Odometry& o) {
  double sum = o.time_offset_s;
  for (const double x : o.covariance) sum += x;
  for (const double x : o.q_WB) sum += x;
  for (std::size_t i = 0; i < 3; ++i)
    sum += o.p_WB_m[i] + o.v_WB_m_s[i] + o.omega_B_rad_s[i] + o.accelerometer_bias_m_s2[i] + o.gyroscope_bias_rad_s[i];
  return std::isfinite(sum);
}

/// Flies until `then`, when something breaks, and on for eight seconds. What is published is finite throughout.
struct Broken {
  template <class Break>
  Broken(Rig& rig, const Flight& flight, double then, Break&& break_it) {
    rig.run_to(then);
    EXPECT_TRUE(rig.last().has_pose);
    const Vec3 p = rig.p();
    const Mat3 R = rig.R();
    const std::uint32_t counter = rig.odometry().reset_counter;
    break_it();
    rig.run_to(then + 8, [&] {
      EXPECT_TRUE(!rig.last().has_pose || is_finite(rig.odometry())) << rig.now();
      if (reset_s < 0 && rig.odometry().reset_counter > counter) reset_s = rig.now() - then;
      if (reset_s < 0 || restarted_s >= 0 || !rig.last().has_pose) return;
      restarted_s = rig.now() - then;
      error = error_since(rig, flight, then, p, R);
      sigma = rig.sigma_position();
    });
  }
  double reset_s = -1, restarted_s = -1, sigma = 0;
  Displaced error{};
};

struct Spoiling {
  const char* name;
  void (*spoil)(NavState&);
};
void PrintTo(const Spoiling& s, std::ostream* out) { *out << s.name; }

class EstimatorNotFinite : public testing::TestWithParam<Spoiling> {};

TEST_P(EstimatorNotFinite, AStateInFlightEndsInAStartWhereItWasLast) {
  // GIVEN a flight in whose newest frame one number becomes none
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  const Broken broken(rig, flight, 7.05, [&] { GetParam().spoil(opened(rig.estimator()).window.newest().x); });
  // THEN the next solved frame resets, and it starts again where it was last, as far as it knows
  EXPECT_GT(broken.reset_s, 0);
  EXPECT_LT(broken.reset_s, 0.11);
  ASSERT_GT(broken.restarted_s, 0);
  EXPECT_LT(broken.restarted_s, 3);
  EXPECT_LT(broken.error.p.norm(), 3 * broken.sigma + 0.06 * broken.restarted_s * broken.restarted_s);
  EXPECT_EQ(rig.odometry().reset_counter, 1u);
  EXPECT_EQ(rig.stats().resets, 1u);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_LT(rig.velocity_error(), 0.1);
}

/// The offset of a height sensor belongs to the world, and its first reading in a new one is no jump.
TEST(EstimatorReset, ForgetsTheOffsetsOfHeightSensors) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  int readings = 0;
  rig.before_imu = [&](const ImuSample& s) {
    if (++readings % 10 != 0) return;
    const double t = (s.stamp - at(0)).seconds();
    rig.estimator().add_height({s.stamp, HeightKind::kBarometer, 100 + flight.p(t).z()});
  };
  const Broken broken(rig, flight, 7.05, [&] { opened(rig.estimator()).window.newest().x.p[1] = kNone; });
  ASSERT_GT(broken.restarted_s, 0);
  EXPECT_EQ(rig.stats().resets, 1u);
  EXPECT_GT(rig.stats().height_frames[0], 100u);
  EXPECT_EQ(rig.stats().height_jumps[0], 0u);
}

INSTANTIATE_TEST_SUITE_P(
    Numbers, EstimatorNotFinite,
    testing::Values(Spoiling{"position", [](NavState& x) { x.p[1] = kNone; }},
                    Spoiling{"velocity", [](NavState& x) { x.v[0] = std::numeric_limits<double>::infinity(); }},
                    Spoiling{"attitude", [](NavState& x) { x.R(2, 1) = kNone; }}),
    [](const auto& test) { return std::string(test.param.name); });

/// No interval can be integrated with it. The state that was published last goes on with its own bias.
TEST(EstimatorNotFinite, ABiasInFlightCostsTheWindowOnly) {
  for (const bool gyroscope : {false, true}) {
    const Flight flight{.moving_from = 2};
    Rig rig(flight, {});
    const Broken broken(rig, flight, 7.05, [&] {
      NavState& x = opened(rig.estimator()).window.newest().x;
      (gyroscope ? x.b_g : x.b_a)[1] = kNone;
    });
    EXPECT_LT(broken.reset_s, 0);
    EXPECT_EQ(rig.stats().resets, 0u);
    EXPECT_EQ(rig.stats().carried_starts, 1u);
    EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
    EXPECT_LT(rig.velocity_error(), 0.1);
  }
}

/// What no solve can mend: the IMU goes on alone, and the health names the rejected steps.
TEST(EstimatorNotFinite, APriorLeavesTheImuAloneAndTheCovarianceGrows) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  rig.run_to(7.05);
  const Vec3 p = rig.p();
  const Mat3 R = rig.R();
  const std::uint64_t failures = rig.stats().solver_failures;
  opened(rig.estimator()).window.prior.b[0] = kNone;
  double sigma = 0;
  int solves = 0, bad = 0;
  rig.run_to(10, [&] {
    ASSERT_TRUE(rig.last().has_pose);
    EXPECT_TRUE(is_finite(rig.odometry()));
    if (rig.now() > 7.15) {
      EXPECT_GT(rig.sigma_position(), sigma) << "at " << rig.now();
      sigma = rig.sigma_position();
    }
    solves += rig.last().solved;
    bad += rig.last().solved && rig.has(HealthReason::kStepsRejected);
    EXPECT_LT(error_since(rig, flight, 7.05, p, R).p.norm(), 3 * rig.sigma_position() + 0.02);
  });
  EXPECT_EQ(rig.stats().solver_failures - failures, static_cast<std::uint64_t>(solves));
  EXPECT_GE(bad, solves - 2);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kDegraded);
}

/// The readings are missing as well, so that nothing can be carried over.
TEST(EstimatorReset, WhileTheCameraIsSilentHappensAtItsNextImage) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  const Broken broken(rig, flight, 7, [&] {
    rig.camera = false;
    rig.run_to(8);
    rig.imu = false;
    rig.run_to(10);
    EXPECT_EQ(rig.stats().resets, 0u) << "nobody has asked for a pose yet";
    rig.imu = true;
    rig.run_to(11);
    rig.camera = true;
  });
  EXPECT_NEAR(broken.reset_s, 4.05, 0.01);
  ASSERT_GT(broken.restarted_s, 0);
  EXPECT_GT(broken.sigma, 1) << "two seconds without readings";
  EXPECT_LT(broken.error.p.norm(), 3 * broken.sigma);
  EXPECT_EQ(rig.stats().resets, 1u);
}

/// A second failure before the first is mended is no second reset; one after it is. Each takes from what is known.
TEST(EstimatorReset, TwiceIsCountedTwiceAndKnowsLessEachTime) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  double sigma = 0;
  for (std::uint32_t n = 1; n <= 2; ++n) {
    SCOPED_TRACE(n);
    const Broken broken(rig, flight, 8.0 * n, [&] {
      rig.imu = rig.camera = false;
      rig.run_to(8.0 * n + 1);
      rig.imu = rig.camera = true;
      rig.run_to(8.0 * n + 1.2);
      rig.imu = rig.camera = false;  // again, before it has started
      rig.run_to(8.0 * n + 1.6);
      rig.imu = rig.camera = true;
      rig.spoil = [n](TrackedFrame& frame) { rename_tracks(n, frame); };
    });
    ASSERT_GT(broken.restarted_s, 0);
    EXPECT_EQ(rig.odometry().reset_counter, n);
    EXPECT_EQ(rig.stats().resets, n);
    EXPECT_TRUE(rig.stats().origins[n].known);
    EXPECT_EQ(rig.stats().origins[n].reset_counter, n);
    EXPECT_LT(broken.error.p.norm(), 3 * broken.sigma);
    EXPECT_GT(broken.sigma, sigma + 0.1);
    sigma = broken.sigma;
    EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  }
}

/// The camera's stamps are 6 ms early, which the estimator finds out. What stands on that clock keeps it; a search from
/// nothing begins with the offset that was configured.
TEST(EstimatorReset, KeepsTheClockThatACarriedStateStandsOnAndNoOther) {
  for (const bool with_imu : {true, false}) {
    const Flight flight{.moving_from = 2};
    Rig rig(flight, {});
    rig.time_offset = 6e-3;
    rig.run_to(14);
    const double found = rig.odometry().time_offset_s;
    ASSERT_NEAR(found, 6e-3, 2e-3);
    rig.camera = false;
    rig.imu = with_imu;
    rig.run_to(20);  // too long for the window
    rig.camera = rig.imu = true;
    rig.run_to(20.05);
    if (with_imu) {
      EXPECT_EQ(rig.stats().start_kind, StartKind::kCarried);
      EXPECT_NEAR(rig.odometry().time_offset_s, found, 1e-9);
      EXPECT_EQ(opened(rig.estimator()).window.calibration.time_offset, rig.odometry().time_offset_s);
    } else {
      EXPECT_EQ(rig.stats().resets, 1u);
      EXPECT_EQ(opened(rig.estimator()).window.calibration.time_offset, 0);
    }
  }
}

}  // namespace
}  // namespace epiline::test
