#include "drivers/laboratory/simulate/flights.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

constexpr int kSeeds = 3;

Flight flight_of(FlightKind kind, int seed) {
  Random random(static_cast<std::uint64_t>(seed), 0);
  return make_flight(kind, random);
}

class EveryFlight : public testing::TestWithParam<FlightKind> {};

INSTANTIATE_TEST_SUITE_P(Flights, EveryFlight, testing::ValuesIn(kAllFlights),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

TEST(FlightNames, GoThereAndBack) {
  for (const FlightKind kind : kAllFlights) EXPECT_EQ(flight_from(to_string(kind)), kind);
  EXPECT_FALSE(flight_from("holding pattern"));
}

TEST_P(EveryFlight, DerivativesAgreeWithDifferences) {
  constexpr double kStep = 1e-4;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Flight flight = flight_of(GetParam(), seed);
    Random random(static_cast<std::uint64_t>(seed), 99);
    for (int i = 0; i < 200; ++i) {
      const double t = random.uniform(kStep, flight.duration_s() - kStep);
      const Motion a = flight.at(t - kStep), m = flight.at(t), b = flight.at(t + kStep);
      SCOPED_TRACE("seed " + std::to_string(seed) + ", t " + std::to_string(t));
      EXPECT_LT(((b.p_WB - a.p_WB) / (2 * kStep) - m.v_WB).norm(), 1e-6);
      // the third derivative jumps at the knots: first order there
      EXPECT_LT(((b.v_WB - a.v_WB) / (2 * kStep) - m.a_WB).norm(), 1e-2);
      EXPECT_LT((so3_log(a.R_WB.transpose() * b.R_WB) / (2 * kStep) - m.omega_B).norm(), 1e-5);
      EXPECT_LT((m.R_WB * m.R_WB.transpose() - Mat3::Identity()).norm(), 1e-12);
      EXPECT_LT((m.R_WB * m.specific_force_B() - m.a_WB - Vec3(0, 0, 9.81)).norm(), 1e-10);
    }
  }
}

TEST_P(EveryFlight, StaysInsideItsRoom) {
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Flight flight = flight_of(GetParam(), seed);
    for (double t = 0; t <= flight.duration_s(); t += 0.05) {
      const Vec3 p = flight.at(t).p_WB;
      ASSERT_TRUE((p.array() > flight.room().low.array()).all() && (p.array() < flight.room().high.array()).all())
          << "seed " << seed << ", t " << t << ": " << p.transpose();
    }
  }
}

TEST_P(EveryFlight, DependsOnTheSeedOnly) {
  const Motion a = flight_of(GetParam(), 1).at(3.3), b = flight_of(GetParam(), 1).at(3.3),
               c = flight_of(GetParam(), 2).at(3.3);
  EXPECT_EQ(a.p_WB, b.p_WB);
  EXPECT_EQ(a.R_WB, b.R_WB);
  EXPECT_TRUE(a.p_WB != c.p_WB || a.R_WB != c.R_WB);
}

struct Extremes {
  double duration_s, speed_mean = 0, speed_max = 0, omega_max = 0;
};

Extremes extremes(FlightKind kind, double begin_s, double end_s) {
  Extremes e{flight_of(kind, 1).duration_s()};
  int n = 0;
  for (int seed = 1; seed <= 5; ++seed) {
    const Flight flight = flight_of(kind, seed);
    for (double t = begin_s; t < std::min(end_s, flight.duration_s()); t += 0.02, ++n) {
      const Motion m = flight.at(t);
      e.speed_mean += m.v_WB.norm();
      e.speed_max = std::max(e.speed_max, m.v_WB.norm());
      e.omega_max = std::max(e.omega_max, m.omega_B.norm());
    }
  }
  e.speed_mean /= n;
  return e;
}

TEST(FlightStatistics, AgileTurnsAtTwoMetresASecond) {
  const Extremes e = extremes(FlightKind::kAgile, 0, 1e9);
  EXPECT_NEAR(e.duration_s, 39.4, 1e-9);
  EXPECT_NEAR(e.speed_mean, 2, 0.4);
  EXPECT_GT(e.omega_max, 1);
}

TEST(FlightStatistics, HallIsSlower) {
  const Extremes e = extremes(FlightKind::kHall, 0, 1e9);
  EXPECT_NEAR(e.duration_s, 59.4, 1e-9);
  EXPECT_NEAR(e.speed_mean, 1.2, 0.3);
}

TEST(FlightStatistics, HoverDriftsSlowly) {
  const Extremes e = extremes(FlightKind::kHover, 10, 66);
  EXPECT_NEAR(e.duration_s, 75.4, 1e-9);
  EXPECT_GT(e.speed_mean, 0.005);
  EXPECT_LT(e.speed_max, 0.1);
  EXPECT_GT(extremes(FlightKind::kHover, 0, 7).speed_mean, 0.5);
  EXPECT_GT(extremes(FlightKind::kHover, 69, 75).speed_mean, 0.5);
}

TEST(FlightStatistics, StillIsExactlyStill) {
  const Extremes e = extremes(FlightKind::kStill, 9.5, 46.5);
  EXPECT_NEAR(e.duration_s, 55.4, 1e-9);
  EXPECT_LT(e.speed_max, 1e-12);
  EXPECT_LT(e.omega_max, 1e-12);
  EXPECT_GT(extremes(FlightKind::kStill, 0, 7).speed_mean, 0.5);
}

TEST(FlightStatistics, StraightHasConstantSpeed) {
  const Extremes e = extremes(FlightKind::kStraight, 8, 1e9);
  EXPECT_NEAR(e.duration_s, 49.4, 1e-9);
  EXPECT_NEAR(e.speed_mean, 1.5, 1e-9);
  EXPECT_NEAR(e.speed_max, 1.5, 1e-9);
  EXPECT_LT(e.omega_max, 1e-12);
  // the camera, along the body's x axis, looks along W's y axis
  EXPECT_LT((flight_of(FlightKind::kStraight, 1).at(20).R_WB * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-12);
}

TEST(FlightStatistics, CorridorGoesForward) {
  const Extremes e = extremes(FlightKind::kCorridor, 7, 1e9);
  EXPECT_NEAR(e.duration_s, 49.4, 1e-9);
  EXPECT_NEAR(e.speed_mean, 1.3, 0.02);
  const Motion m = flight_of(FlightKind::kCorridor, 1).at(20);
  EXPECT_GT((m.R_WB * Vec3::UnitX()).dot(m.v_WB.normalized()), 0.99);
}

TEST(FlightStatistics, PureRotationDoesNotMove) {
  const Extremes e = extremes(FlightKind::kPureRotation, 9.5, 26.5);
  EXPECT_NEAR(e.duration_s, 35.4, 1e-9);
  EXPECT_LT(e.speed_max, 1e-12);
  EXPECT_NEAR(e.omega_max, 1.2 * 0.55, 0.2);
}

TEST(FlightStatistics, StandstillRestsOnTheGroundAtBothEnds) {
  for (int seed = 1; seed <= 5; ++seed) {
    const Flight flight = flight_of(FlightKind::kStandstill, seed);
    EXPECT_NEAR(flight.duration_s(), 45, 1e-9);
    const Motion begin = flight.at(0), end = flight.at(45);
    for (int i = 0; i < 1000; ++i) {
      const double t = (i < 500 ? 0 : 35) + i * 0.01;
      const Motion m = flight.at(t), there = i < 500 ? begin : end;
      ASSERT_LT(m.v_WB.norm() + m.a_WB.norm() + m.omega_B.norm(), 1e-11) << "seed " << seed << ", t " << t;
      ASSERT_LT((m.p_WB - there.p_WB).norm(), 1e-12) << "seed " << seed << ", t " << t;
    }
    EXPECT_NEAR(begin.p_WB.z(), 0, 1e-12);
    EXPECT_NEAR(end.p_WB.z(), 0, 1e-12);
    EXPECT_GT(flight.at(5.5).v_WB.norm(), 1e-3);
  }
  EXPECT_GT(extremes(FlightKind::kStandstill, 9, 33).speed_mean, 0.5);
}

TEST(FlightStatistics, ARoverGoesWhereItLooksOverTheGround) {
  for (int seed = 1; seed <= 5; ++seed) {
    const Flight flight = flight_of(FlightKind::kRover, seed);
    EXPECT_NEAR(flight.duration_s(), 60, 1e-9);
    double path = 0, turned_in_place = 0, rested_s = 0, square_z = 0;
    constexpr double kStep_s = 0.005;
    for (double t = 0; t < 60; t += kStep_s) {
      const Motion m = flight.at(t);
      const Vec3 v_B = m.R_WB.transpose() * m.v_WB;
      SCOPED_TRACE("seed " + std::to_string(seed) + ", t " + std::to_string(t));
      ASSERT_GT(v_B.x(), -1e-3);
      ASSERT_LT(std::abs(v_B.y()), 3e-3);
      ASSERT_LT(std::abs(m.p_WB.z()), 0.01);
      ASSERT_LT(std::hypot(m.R_WB(2, 0), m.R_WB(2, 1)), 0.02);
      ASSERT_LT(m.a_WB.head<2>().norm(), 1.5);
      ASSERT_LT(std::abs(m.omega_B.z()), 1.3);
      path += kStep_s * m.v_WB.norm();
      square_z += m.p_WB.z() * m.p_WB.z() / (60 / kStep_s);
      if (m.v_WB.norm() < 1e-9) (m.omega_B.norm() < 1e-9 ? rested_s : turned_in_place) += kStep_s;
    }
    EXPECT_GT(path, 15);
    EXPECT_GT(rested_s, 5);
    EXPECT_GT(turned_in_place, 3);
    EXPECT_NEAR(std::sqrt(square_z), 1e-3, 0.5e-3);
  }
}

}  // namespace
}  // namespace epiline
