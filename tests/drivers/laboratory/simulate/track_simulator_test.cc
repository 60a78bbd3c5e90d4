#include "drivers/laboratory/simulate/track_simulator.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace epiline {
namespace {

TrackSimulation setup(FlightKind kind, std::uint64_t seed = 1) {
  TrackSimulation s;
  s.flight = kind;
  s.seed = seed;
  s.noise.pixel_sigma = 0;
  return s;
}

class EveryTrackedFlight : public testing::TestWithParam<FlightKind> {};

INSTANTIATE_TEST_SUITE_P(Flights, EveryTrackedFlight, testing::ValuesIn(kAllFlights),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

TEST_P(EveryTrackedFlight, TracksLiveAsLongAsInTheStudy) {
  // The last three were not in the study: their figures only say that nothing has changed.
  const std::map<FlightKind, double> expected{{FlightKind::kAgile, 13},        {FlightKind::kCorridor, 16},
                                              {FlightKind::kPureRotation, 23}, {FlightKind::kStraight, 30},
                                              {FlightKind::kHall, 35},         {FlightKind::kStill, 46},
                                              {FlightKind::kHover, 49},        {FlightKind::kStandstill, 34},
                                              {FlightKind::kRover, 22},        {FlightKind::kSurvey, 50}};
  double life = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) life += simulate_tracks(setup(GetParam(), seed)).mean_track_life / 4;
  EXPECT_NEAR(life, expected.at(GetParam()), 0.25 * expected.at(GetParam()));
}

TEST_P(EveryTrackedFlight, ImagesAndSamplesAreOnTime) {
  const SimulatedFlight flight = simulate_tracks(setup(GetParam()));
  ASSERT_GT(flight.images.size(), 600u);
  for (std::size_t i = 0; i < flight.imu.size(); ++i)
    ASSERT_EQ((flight.imu[i].stamp - kFlightBegin).ns, static_cast<std::int64_t>(i) * 5'000'000);
  for (std::size_t k = 0; k < flight.images.size(); ++k) {
    ASSERT_EQ(flight.images[k].stamp, flight.imu[10 * k].stamp);
    ASSERT_EQ(flight.images[k].end - flight.images[k].begin, 150u);
  }
}

/// Without noise, the rays of one track from the true poses meet in one point.
TEST_P(EveryTrackedFlight, NoiselessBearingsMeetInOnePoint) {
  const SimulatedFlight flight = simulate_tracks(setup(GetParam(), 3));
  struct Rays {
    Mat3 A = Mat3::Zero();
    Vec3 b = Vec3::Zero();
    std::vector<std::pair<Vec3, Vec3>> lines;  // centre, direction
  };
  std::map<std::uint32_t, Rays> tracks;
  TrackedFrame frame;
  for (std::size_t k = 0; k < flight.images.size(); k += 5) {
    flight.fill(k, frame);
    const BodyState& x = flight.images[k].truth;
    for (const TrackedFeature& f : frame.features) {
      const Vec3 centre = x.p_WB + x.R_WB * flight.extrinsics.p_BC;
      const Vec3 ray = x.R_WB * flight.extrinsics.R_BC * vec3(f.bearing);
      Rays& r = tracks[f.id];
      const Mat3 P = Mat3::Identity() - ray * ray.transpose();
      r.A += P;
      r.b += P * centre;
      r.lines.emplace_back(centre, ray);
    }
  }
  int judged = 0;
  for (const auto& [id, r] : tracks) {
    if (r.lines.size() < 3 || r.A.determinant() < 1e-3) continue;
    const Vec3 point = r.A.inverse() * r.b;
    for (const auto& [centre, ray] : r.lines) {
      ASSERT_LT((point - centre).cross(ray).norm(), 1e-6) << "track " << id;
      ASSERT_GT((point - centre).dot(ray), 0) << "track " << id;
    }
    ++judged;
  }
  EXPECT_GT(judged, 100);
}

TEST(TrackSimulatorTest, FeaturesCarryTheCamera) {
  TrackSimulation s = setup(FlightKind::kAgile);
  s.noise = {1, 0.02, 0.1};
  const SimulatedFlight flight = simulate_tracks(s);
  TrackedFrame frame;
  flight.fill(40, frame);
  EXPECT_EQ(frame.stamp, flight.images[40].stamp);
  EXPECT_EQ(frame.sequence, 40u);
  // the camera looks ahead, its x axis to the right, its y axis down
  const Mat3& R_BC = flight.extrinsics.R_BC;
  EXPECT_EQ(R_BC.col(0), -Vec3::UnitY());
  EXPECT_EQ(R_BC.col(1), -Vec3::UnitZ());
  EXPECT_EQ(R_BC.col(2), Vec3::UnitX());
  ASSERT_EQ(frame.features.size(), 150u);
  const auto project = [](const Vec3& p) { return Vec2(375.5 + 458 * p.x() / p.z(), 239.5 + 458 * p.y() / p.z()); };
  for (const TrackedFeature& f : frame.features) {
    const Vec3 b = vec3(f.bearing);
    EXPECT_NEAR(b.norm(), 1, 1e-14);
    EXPECT_LT((project(b) - Vec2(f.pixel[0], f.pixel[1])).norm(), 1e-4);
    const Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> J(f.pixel_jacobian.data());
    EXPECT_LT((J * b).norm(), 1e-10);
    for (int k = 0; k < 3; ++k) {
      const Vec3 d = 1e-6 * Vec3::Unit(k);
      EXPECT_LT(((project(b + d) - project(b - d)) / 2e-6 - J.col(k)).norm(), 1e-4);
    }
  }
}

TEST(TrackSimulatorTest, AgeAndVelocityComeFromThePreviousImage) {
  TrackSimulation s = setup(FlightKind::kHall);
  s.noise.pixel_sigma = 1;
  const SimulatedFlight flight = simulate_tracks(s);
  std::map<std::uint32_t, TrackObservation> before;
  std::set<std::uint32_t> ended;
  for (const SimulatedImage& image : flight.images) {
    std::map<std::uint32_t, TrackObservation> now;
    for (std::size_t i = image.begin; i < image.end; ++i) {
      const TrackObservation& o = flight.observations[i];
      ASSERT_TRUE(now.emplace(o.id, o).second) << "track " << o.id << " twice in one image";
      ASSERT_FALSE(ended.contains(o.id));
      const auto last = before.find(o.id);
      ASSERT_EQ(o.age, last == before.end() ? 0 : last->second.age + 1);
      const Vec2 velocity = last == before.end() ? Vec2::Zero() : Vec2((o.pixel - last->second.pixel) / 0.05);
      ASSERT_LT((o.velocity_px_s - velocity).norm(), 1e-9);
    }
    for (const auto& [id, o] : before)
      if (!now.contains(id)) ended.insert(id);
    before.swap(now);
  }
}

/// Errors of the observations: the same flight with and without noise differs in nothing else.
std::vector<std::pair<std::uint32_t, Vec2>> errors_by_age(FlightKind kind, const TrackNoise& noise) {
  TrackSimulation s = setup(kind, 2);
  const SimulatedFlight clean = simulate_tracks(s);
  s.noise = noise;
  const SimulatedFlight noisy = simulate_tracks(s);
  std::vector<std::pair<std::uint32_t, Vec2>> errors;
  for (std::size_t i = 0; i < clean.observations.size(); ++i) {
    EXPECT_EQ(clean.observations[i].id, noisy.observations[i].id);
    errors.emplace_back(clean.observations[i].age, noisy.observations[i].pixel - clean.observations[i].pixel);
  }
  return errors;
}

TEST(TrackSimulatorTest, WhiteNoiseHasItsSigma) {
  Vec2 mean = Vec2::Zero(), square = Vec2::Zero();
  const auto errors = errors_by_age(FlightKind::kStill, {.pixel_sigma = 0.7});
  for (const auto& [age, e] : errors) {
    mean += e / static_cast<double>(errors.size());
    square += e.cwiseAbs2() / static_cast<double>(errors.size());
  }
  EXPECT_LT(mean.norm(), 0.01);
  EXPECT_NEAR(std::sqrt(square.x()), 0.7, 0.01);
  EXPECT_NEAR(std::sqrt(square.y()), 0.7, 0.01);
}

TEST(TrackSimulatorTest, DriftGrowsWithTheRootOfTheAge) {
  double square[2] = {};
  int n[2] = {};
  for (const auto& [age, e] : errors_by_age(FlightKind::kStill, {.pixel_sigma = 0, .drift_px = 0.1})) {
    if (age == 0) {
      EXPECT_EQ(e.norm(), 0);
    }
    for (int k = 0; k < 2; ++k)
      if (age == (k ? 64u : 16u)) {
        square[k] += 0.5 * e.squaredNorm();
        ++n[k];
      }
  }
  EXPECT_NEAR(std::sqrt(square[0] / n[0]), 0.4, 0.04);
  EXPECT_NEAR(std::sqrt(square[1] / n[1]), 0.8, 0.08);
}

TEST(TrackSimulatorTest, OutliersHaveTheirShares) {
  TrackSimulation s = setup(FlightKind::kStill, 4);
  s.noise.outlier_share = 0.1;
  const SimulatedFlight flight = simulate_tracks(s);
  // At rest nothing moves but drifters, steadily, and gross errors, there and back.
  std::map<std::uint32_t, std::vector<Vec2>> tracks;
  for (std::size_t k = 200; k < 920; ++k)
    for (std::size_t i = flight.images[k].begin; i < flight.images[k].end; ++i)
      tracks[flight.observations[i].id].push_back(flight.observations[i].pixel);
  int judged = 0, drifting = 0, steps = 0, gross = 0;
  for (const auto& [id, pixels] : tracks) {
    if (pixels.size() < 10) continue;
    std::vector<double> lengths;
    for (std::size_t i = 1; i < pixels.size(); ++i) lengths.push_back((pixels[i] - pixels[i - 1]).norm());
    std::nth_element(lengths.begin(), lengths.begin() + static_cast<long>(lengths.size() / 2), lengths.end());
    const double usual = lengths[lengths.size() / 2];
    const bool drifts = usual > 1e-6;
    if (drifts) {
      EXPECT_GT(usual, 0.29) << "track " << id;
    }
    ++judged;
    drifting += drifts;
    for (std::size_t i = 1; i + 1 < pixels.size(); ++i, ++steps)
      gross += (pixels[i] - 0.5 * (pixels[i - 1] + pixels[i + 1])).norm() > 1e-3 &&
               (pixels[i - 1] - pixels[i + 1]).norm() < 3.1;
  }
  EXPECT_GT(judged, 1000);
  EXPECT_NEAR(static_cast<double>(drifting) / judged, 0.1, 0.03);
  // a gross error stands alone with probability 0.95^2
  EXPECT_NEAR(static_cast<double>(gross) / steps, 0.05 * 0.9025, 0.003);
}

TEST(TrackSimulatorTest, TimeOffsetShiftsStampsOnly) {
  TrackSimulation s = setup(FlightKind::kCorridor);
  const SimulatedFlight plain = simulate_tracks(s);
  s.time_offset_s = 0.004;
  const SimulatedFlight shifted = simulate_tracks(s);
  EXPECT_EQ(shifted.extrinsics.time_offset_s, 0.004);
  for (std::size_t k = 0; k < plain.images.size(); ++k) {
    ASSERT_EQ((plain.images[k].stamp - shifted.images[k].stamp).ns, 4'000'000);
    ASSERT_EQ(plain.images[k].stamp_true, shifted.images[k].stamp_true);
    ASSERT_EQ(plain.images[k].truth.p_WB, shifted.images[k].truth.p_WB);
  }
}

TEST(TrackSimulatorTest, DependsOnTheSeedOnly) {
  TrackSimulation s = setup(FlightKind::kAgile, 8);
  s.noise = {1, 0.02, 0.1};
  const SimulatedFlight a = simulate_tracks(s), b = simulate_tracks(s);
  s.seed = 9;
  const SimulatedFlight c = simulate_tracks(s);
  ASSERT_EQ(a.observations.size(), b.observations.size());
  for (std::size_t i = 0; i < a.observations.size(); ++i) ASSERT_EQ(a.observations[i].pixel, b.observations[i].pixel);
  for (std::size_t i = 0; i < a.imu.size(); ++i) {
    ASSERT_EQ(a.imu[i].angular_velocity_rad_s, b.imu[i].angular_velocity_rad_s);
    ASSERT_EQ(a.imu[i].specific_force_m_s2, b.imu[i].specific_force_m_s2);
  }
  EXPECT_NE(a.observations[0].pixel, c.observations[0].pixel);
  EXPECT_NE(a.imu[0].specific_force_m_s2, c.imu[0].specific_force_m_s2);
}

}  // namespace
}  // namespace epiline
