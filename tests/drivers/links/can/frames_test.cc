// Frames as somebody reads them who has the DBC file and nothing else of us.
#include "drivers/links/can/frames.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "drivers/links/can/dbc.h"
#include "estimator/geometry/so3.h"
#include "tests/drivers/links/can/dbc_reader.h"

namespace epiline::can {
namespace {

constexpr int kBase = 0x2a0;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

const std::map<int, dbc::MessageText>& dbc_file() {
  static const auto file = dbc::read(dbc_text(kBase));
  return file;
}
std::span<const std::uint8_t> bytes(const Frame& f) { return {f.data.data(), f.size}; }
dbc::Reading read(const Frame& f, const std::string& signal) {
  return dbc::read(dbc_file().at(f.id).signals.at(signal), bytes(f));
}
/// In whichever frame it is.
const Frame& frame_with(const Frames& frames, const std::string& signal) {
  for (const Frame& f : frames)
    if (dbc_file().at(f.id).signals.count(signal) != 0) return f;
  throw std::runtime_error("no " + signal);
}
dbc::Reading read(const Frames& frames, const std::string& signal) { return read(frame_with(frames, signal), signal); }

/// Bit by bit, as SAE J1850 has it.
std::uint8_t plain_crc(std::span<const std::uint8_t> data) {
  unsigned crc = 0xff;
  for (const std::uint8_t byte : data)
    for (int bit = 7; bit >= 0; --bit) {
      const unsigned high = (crc >> 7 ^ byte >> bit) & 1;
      crc = (crc << 1 & 0xff) ^ (high != 0 ? 0x1d : 0);
    }
  return static_cast<std::uint8_t>(crc ^ 0xff);
}
bool is_whole(const Frame& f) {
  std::vector<std::uint8_t> covered = {static_cast<std::uint8_t>(f.id & 0xff), static_cast<std::uint8_t>(f.id >> 8)};
  covered.insert(covered.end(), f.data.begin() + 1, f.data.begin() + f.size);
  return plain_crc(covered) == f.data[0];
}

TEST(CanFrames, TheChecksumIsThePublishedOne) {
  // "123456789" gives 0x4b: in the catalogue of checksums as CRC-8/SAE-J1850
  const std::array<std::uint8_t, 8> data = {0, '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(crc_of(0x3231, data), 0x4b);
}

TEST(CanFrames, TheFileNamesEveryMessageOnce) {
  EXPECT_EQ(dbc_file().size(), kMessages.size());
  for (const auto& [id, message] : dbc_file()) {
    EXPECT_EQ(message.fd, message.size == 64) << message.name;
    EXPECT_TRUE(message.fd || message.size == 8) << message.name;
  }
  EXPECT_EQ(dbc_file().at(kBase).name, "EpilineStatus");
}

/// Any number: small, in the range, beyond it, none at all.
double any_number(double most) {
  const int kind = *rc::gen::inRange(0, 20);
  if (kind == 0) return kNaN;
  if (kind == 1) return std::numeric_limits<double>::infinity();
  if (kind == 2) return -std::numeric_limits<double>::infinity();
  const double part = *rc::gen::inRange(-1'000'000'000, 1'000'000'001) * 1e-9;
  return part * most * (kind == 3 ? 1e9 : kind < 8 ? 1.01 : kind < 14 ? 1 : 1e-4);
}

// Half a step of the scale, and what the file's own decimals leave open.
void expect_read_back(const dbc::SignalText& s, const dbc::Reading& reading, double value) {
  if (std::isnan(value)) {
    RC_ASSERT(reading.name == "not available");
    return;
  }
  RC_ASSERT(reading.name.empty());
  const double expected = std::clamp(value, s.least, s.most);
  RC_ASSERT(std::abs(reading.value - expected) <= 0.5 * s.scale * (1 + 1e-9) + 1e-9 * std::abs(expected));
}

/// What the frames measure, by our own table: which axis is which is for the tests below.
std::map<std::string, Quantity> measured_in(const Frames& frames) {
  std::map<std::string, Quantity> measured;
  for (const Frame& f : frames)
    for (const Signal& s : kMessages[static_cast<std::size_t>(f.id - kBase)].signals)
      if (s.has_gap_value() && s.quantity != Quantity::kState) measured[s.name] = s.quantity;
  return measured;
}

RC_GTEST_PROP(CanFrames, WhatIsPackedIsReadBack, (bool fd)) {
  FrameWriter writer(kBase, fd);
  const Frames empty = writer.odometry({}, true);
  const auto find = [&](const std::string& name) { return dbc_file().at(frame_with(empty, name).id).signals.at(name); };
  Values values;
  for (const auto& [name, quantity] : measured_in(empty)) values[quantity] = any_number(find(name).most);
  const Frames frames = writer.odometry(values, true);
  RC_ASSERT(frames.size() == (fd ? 4U : 9U));
  for (const Frame& f : frames) {
    RC_ASSERT(is_whole(f));
    RC_ASSERT(f.is_fd() == dbc_file().at(f.id).fd);
  }
  for (const auto& [name, quantity] : measured_in(frames))
    expect_read_back(find(name), read(frames, name), values[quantity]);
}

RC_GTEST_PROP(CanFrames, EveryBitThatIsChangedIsNoticed, (bool fd)) {
  FrameWriter writer(kBase, fd);
  Values values;
  values[Quantity::kPositionX] = any_number(100);
  Frame frame = writer.odometry(values, false)[*rc::gen::inRange(0, fd ? 1 : 6)];
  RC_ASSERT(is_whole(frame));
  const auto bit = *rc::gen::inRange(0, 8 * frame.size);
  frame.data[static_cast<std::size_t>(bit / 8)] ^= static_cast<std::uint8_t>(1 << bit % 8);
  RC_ASSERT(!is_whole(frame));
}

TEST(CanFrames, FramesOfAnEpochShareItsNumberAndEachIdentifierCounts) {
  for (const bool fd : {false, true}) {
    FrameWriter writer(kBase, fd);
    std::map<int, long long> alive;
    for (int epoch = 1; epoch < 40; ++epoch) {
      const Frames frames = writer.odometry({}, epoch % 10 == 0);
      for (const Frame& f : frames) {
        EXPECT_EQ(read(f, "Epoch").raw, epoch % 16);
        if (alive.count(f.id) != 0) {
          EXPECT_EQ(read(f, "Alive").raw, (alive[f.id] + 1) % 16);
        }
        alive[f.id] = read(f, "Alive").raw;
      }
      EXPECT_EQ(read(writer.status({}), "Epoch").raw, epoch % 16);
    }
    EXPECT_EQ(alive.size(), fd ? 4U : 9U);
  }
}

// ---- what is said of an estimate ----

const Mat3 kLevel = Mat3::Identity();

Odometry odometry(const Vec3& p_WB, const Mat3& R_WB, const Vec3& v_WB, const Vec3& omega_B) {
  Odometry o;
  o.stamp.ns = 1'234'567'891'234;
  Eigen::Map<Vec3>(o.p_WB_m.data()) = p_WB;
  Eigen::Map<Vec3>(o.v_WB_m_s.data()) = v_WB;
  Eigen::Map<Vec3>(o.omega_B_rad_s.data()) = omega_B;
  const Eigen::Quaterniond q(R_WB);
  o.q_WB = {q.w(), q.x(), q.y(), q.z()};
  o.health = {HealthState::kTracking, bit(HealthReason::kFewTracks), 80};
  o.reset_counter = 3;
  return o;
}
Frames frames_of(const Odometry& o, const Mat3& R_VB, bool fd) {
  const HostStamp now = o.stamp + Span{3'210'000};
  return FrameWriter(kBase, fd).odometry(values_of(o, R_VB, 7, now), true);
}
Vec3 read3(const Frames& frames, const std::string& name) {
  return {read(frames, name + "X").value, read(frames, name + "Y").value, read(frames, name + "Z").value};
}
/// Turns the vehicle's axes into the world's, as a reader puts it together.
Mat3 attitude(const Frames& frames, bool fd) {
  std::array<double, 4> q{};
  if (fd) {
    q = {read(frames, "QuaternionW").value, read(frames, "QuaternionX").value, read(frames, "QuaternionY").value,
         read(frames, "QuaternionZ").value};
  } else {
    const auto largest = static_cast<std::size_t>(read(frames, "AttitudeLargest").raw);
    const double three[] = {read(frames, "AttitudeA").value, read(frames, "AttitudeB").value,
                            read(frames, "AttitudeC").value};
    double rest = 1;
    for (const double v : three) rest -= v * v;
    for (std::size_t i = 0, at = 0; i < 4; ++i) q[i] = i == largest ? std::sqrt(rest) : three[at++];
  }
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

// One metre ahead, two to the left, three up, turned to the left by a quarter, flying to where the nose points.
TEST(CanFrames, LeftIsLeftAndUpIsUp) {
  const Mat3 quarter = so3_exp(Vec3(0, 0, std::numbers::pi / 2));
  for (const bool fd : {false, true}) {
    const Frames frames = frames_of(odometry({1, 2, 3}, quarter, {0, 2, 0.5}, {0.1, -0.2, 0.3}), kLevel, fd);
    EXPECT_LT((read3(frames, "Position") - Vec3(1, 2, 3)).norm(), 1e-9);
    EXPECT_LT((read3(frames, "Velocity") - Vec3(2, 0, 0.5)).norm(), 1e-9);
    EXPECT_LT((read3(frames, "Rate") - Vec3(0.1, -0.2, 0.3)).norm(), 1e-9);
    EXPECT_LT((attitude(frames, fd) - quarter).norm(), 1e-4);
    EXPECT_EQ(read(frames, "Time").raw, 1'234'567'891);
    EXPECT_NEAR(read(frames, "Age").value, 0.00321, 1e-9);
    EXPECT_EQ(read(frames, "ResetCounter").raw, 7) << "who sends counts, not the estimator";
  }
}

RC_GTEST_PROP(CanFrames, AttitudesComeBackWithinTheirResolution, (bool fd)) {
  const auto part = [] { return *rc::gen::inRange(-1000, 1001) * 1e-3; };
  const Vec3 turn(part(), part(), part()), mount(part(), part(), part());
  const Mat3 R_WB = so3_exp(Vec3(std::numbers::pi * turn)), R_VB = so3_exp(Vec3(std::numbers::pi * mount));
  const Frames frames = frames_of(odometry({0, 0, 0}, R_WB, {0, 0, 0}, {0, 0, 0}), R_VB, fd);
  const double most = fd ? 2e-6 : 1.5e-4;  // what docs/can.md promises
  RC_ASSERT(so3_log(Mat3(attitude(frames, fd).transpose() * R_WB * R_VB.transpose())).norm() < most);
}

TEST(CanFrames, DeviationsAreRootsOfTheCovariance) {
  Odometry o = odometry({0, 0, 0}, kLevel, {0, 0, 0}, {0, 0, 0});
  const double sd[] = {0.1, 0.2, 0.3, 0.01, 0.02, 0.03, 0.4, 0.5, 0.6};
  for (std::size_t i = 0; i < 9; ++i) o.covariance[17 * i] = sd[i] * sd[i];
  const Frames frames = frames_of(o, kLevel, true);
  EXPECT_LT((read3(frames, "PositionSd") - Vec3(0.1, 0.2, 0.3)).norm(), 1e-6);
  EXPECT_LT((read3(frames, "AttitudeSd") - Vec3(0.01, 0.02, 0.03)).norm(), 1e-6);
  EXPECT_LT((read3(frames, "VelocitySd") - Vec3(0.4, 0.5, 0.6)).norm(), 1e-6);
  o.covariance[17 * 4] = kNaN;
  const Frames unknown = frames_of(o, kLevel, true);
  EXPECT_EQ(read(unknown, "PositionSdX").name, "not available");
}

TEST(CanFrames, StatusSaysHowItIs) {
  FrameWriter writer(kBase, true);
  Values values = values_of(odometry({0, 0, 0}, kLevel, {0, 0, 0}, {0, 0, 0}).health, 250);
  Frame status = writer.status(values);
  EXPECT_TRUE(is_whole(status));
  EXPECT_EQ(read(status, "State").name, "tracking");
  EXPECT_EQ(read(status, "Quality").raw, 80);
  EXPECT_EQ(read(status, "Reasons").raw, bit(HealthReason::kFewTracks));
  EXPECT_EQ(read(status, "ResetCounter").raw, 250);
  EXPECT_EQ(read(status, "Version").raw, kLayoutVersion);
  values[Quantity::kState] = kSilent;
  values[Quantity::kQuality] = kNaN;
  status = writer.status(values);
  EXPECT_EQ(read(status, "State").name, "silent");
  EXPECT_EQ(read(status, "Quality").name, "not available");
}

// An estimate that went wrong altogether: every number may be anything.
TEST(CanFrames, NumbersThatAreNoneAreSaidToBe) {
  Odometry o = odometry({kNaN, kNaN, kNaN}, kLevel, {kNaN, kNaN, kNaN}, {kNaN, kNaN, kNaN});
  o.q_WB = {kNaN, kNaN, kNaN, kNaN};
  o.covariance.fill(kNaN);
  for (const bool fd : {false, true}) {
    const Frames frames = frames_of(o, kLevel, fd);
    for (const char* name : {"PositionX", "VelocityY", "RateZ", "PositionSdX", "VelocitySdZ", "AttitudeSdY"})
      EXPECT_EQ(read(frames, name).name, "not available") << name;
    EXPECT_EQ(read(frames, fd ? "QuaternionW" : "AttitudeA").name, "not available");
  }
}

}  // namespace
}  // namespace epiline::can
