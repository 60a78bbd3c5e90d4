#include "drivers/laboratory/simulate/flights.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

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

struct Bounds {
  double least, most;
};

/// What a part of a flight is like, over five seeds.
struct Part {
  FlightKind kind;
  double begin_s, end_s, duration_s;  ///< the last one of the whole flight
  Bounds mean_speed;
  double most_speed;
  Bounds fastest_turn;
};

class PartsOfFlights : public testing::TestWithParam<Part> {};

TEST_P(PartsOfFlights, AreAsFastAsTheyAreMeantToBe) {
  const Part& part = GetParam();
  double sum = 0, fastest = 0, turn = 0;
  int n = 0;
  for (int seed = 1; seed <= 5; ++seed) {
    const Flight flight = flight_of(part.kind, seed);
    EXPECT_NEAR(flight.duration_s(), part.duration_s, 1e-9);
    for (double t = part.begin_s; t < std::min(part.end_s, flight.duration_s()); t += 0.02, ++n) {
      const Motion m = flight.at(t);
      sum += m.v_WB.norm();
      fastest = std::max(fastest, m.v_WB.norm());
      turn = std::max(turn, m.omega_B.norm());
    }
  }
  EXPECT_GE(sum / n, part.mean_speed.least);
  EXPECT_LE(sum / n, part.mean_speed.most);
  EXPECT_LE(fastest, part.most_speed);
  EXPECT_GE(turn, part.fastest_turn.least);
  EXPECT_LE(turn, part.fastest_turn.most);
}

constexpr double kAny = 1e9, kNone = 1e-9;
constexpr Bounds kMoving = {0.5, kAny}, kAnyTurn = {0, kAny};
INSTANTIATE_TEST_SUITE_P(
    All, PartsOfFlights,
    testing::Values(Part{FlightKind::kAgile, 0, kAny, 39.4, {1.6, 2.4}, kAny, {1, kAny}},
                    Part{FlightKind::kHall, 0, kAny, 59.4, {0.9, 1.5}, kAny, kAnyTurn},
                    Part{FlightKind::kHover, 0, 7, 75.4, kMoving, kAny, kAnyTurn},
                    Part{FlightKind::kHover, 10, 66, 75.4, {0.005, kAny}, 0.1, kAnyTurn},
                    Part{FlightKind::kHover, 69, 75, 75.4, kMoving, kAny, kAnyTurn},
                    Part{FlightKind::kStill, 0, 7, 55.4, kMoving, kAny, kAnyTurn},
                    Part{FlightKind::kStill, 9.5, 46.5, 55.4, {0, kNone}, kNone, {0, kNone}},
                    Part{FlightKind::kStraight, 8, kAny, 49.4, {1.5 - kNone, 1.5 + kNone}, 1.5 + kNone, {0, kNone}},
                    Part{FlightKind::kCorridor, 7, kAny, 49.4, {1.28, 1.32}, kAny, kAnyTurn},
                    Part{FlightKind::kPureRotation, 9.5, 26.5, 35.4, {0, kNone}, kNone, {0.46, 0.86}},
                    Part{FlightKind::kStandstill, 9, 33, 45, kMoving, kAny, kAnyTurn}));

// The camera is along the body's x axis.
TEST(FlightStatistics, StraightLooksSidewaysAndCorridorForward) {
  EXPECT_LT((flight_of(FlightKind::kStraight, 1).at(20).R_WB * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-12);
  const Motion m = flight_of(FlightKind::kCorridor, 1).at(20);
  EXPECT_GT((m.R_WB * Vec3::UnitX()).dot(m.v_WB.normalized()), 0.99);
}

TEST(FlightStatistics, StandstillRestsOnTheGroundAtBothEnds) {
  for (int seed = 1; seed <= 5; ++seed) {
    const Flight flight = flight_of(FlightKind::kStandstill, seed);
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
