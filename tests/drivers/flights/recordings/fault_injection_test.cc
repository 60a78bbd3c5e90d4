#include "drivers/flights/recordings/fault_injection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace epiline {
namespace {

constexpr HostStamp kFirst{1'000'000'000'000};

std::vector<ImuSample> readings(FaultKind kind, double from_s, double duration_s) {
  const Fault fault{kind, from_s, duration_s};
  ImuFaults faults({&fault, 1}, kFirst);
  std::vector<ImuSample> all;
  for (int i = 0; i < 100; ++i) {
    ImuSample r{kFirst + Span::from_milliseconds(10 * i), {1.0 + i, 0, 0}, {0, 0, 20}};
    r.arrival = r.stamp;
    std::array<ImuSample, ImuFaults::kMost> out;
    const std::size_t n = faults.apply(r, out);
    all.insert(all.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n));
  }
  for (std::size_t i = 1; i < all.size(); ++i) EXPECT_GE(all[i].arrival, all[i - 1].arrival);
  return all;
}

int changed(const std::vector<ImuSample>& all) {
  int n = 0;
  for (const ImuSample& r : all) {
    const auto i = static_cast<double>((r.arrival - kFirst).ns / 10'000'000);
    n += r.stamp != r.arrival || r.angular_velocity_rad_s[0] != 1 + i || std::isnan(r.angular_velocity_rad_s[1]) ||
         r.specific_force_m_s2[2] != 20;
  }
  return n;
}

// The fault lasts from 0.3 s to 0.5 s: twenty of the hundred readings.
TEST(ImuFaults, ChangeWhatTheyAreAskedForAndNothingElse) {
  EXPECT_EQ(changed(readings(FaultKind::kCameraSilent, 0.3, 0.2)), 0) << "of another sensor";
  EXPECT_EQ(readings(FaultKind::kImuSilent, 0.3, 0.2).size(), 80U);
  EXPECT_EQ(readings(FaultKind::kImuDuplicates, 0.3, 0.2).size(), 120U);
  for (const FaultKind kind :
       {FaultKind::kImuNan, FaultKind::kImuSaturated, FaultKind::kImuAhead, FaultKind::kImuBehind})
    EXPECT_EQ(changed(readings(kind, 0.3, 0.2)), 20) << to_string(kind);
  EXPECT_EQ(changed(readings(FaultKind::kImuStuck, 0.3, 0.2)), 19) << "the first is what it is stuck at";
  EXPECT_EQ(changed(readings(FaultKind::kImuOutlier, 0.3, 0)), 1);
  EXPECT_EQ(readings(FaultKind::kImuAhead, 0.3, 0.2)[35].stamp.ns, kFirst.ns + 850'000'000);
  const auto disorder = readings(FaultKind::kImuDisorder, 0.3, 0.2);
  EXPECT_EQ(disorder.size(), 100U);
  int backwards = 0;
  for (std::size_t i = 1; i < disorder.size(); ++i) backwards += disorder[i].stamp < disorder[i - 1].stamp;
  EXPECT_GE(backwards, 3);
}

TEST(CameraFaults, ChangeImagesOnlyWhileTheyLast) {
  constexpr int kWidth = 64, kHeight = 64;
  std::vector<std::uint8_t> pixels(kWidth * kHeight);
  for (const FaultInfo& info : all_faults()) {
    if (is_of_imu(info.kind)) continue;
    const Fault fault{info.kind, 0.3, 0.2};
    CameraFaults faults({&fault, 1}, kFirst, kWidth, kHeight, 2);
    int off = 0;
    for (int i = 0; i < 20; ++i) {
      for (std::size_t k = 0; k < pixels.size(); ++k)
        pixels[k] = static_cast<std::uint8_t>(k + 3 * static_cast<unsigned>(i));
      Frame f;
      f.stamp = f.arrival = kFirst + Span::from_milliseconds(50 * i);
      f.data = pixels.data();
      f.width = f.stride = kWidth;
      f.height = kHeight;
      const bool delivered = faults.apply(f);
      const bool same = delivered && f.stamp == f.arrival && std::equal(pixels.begin(), pixels.end(), f.data);
      const bool first = info.kind == FaultKind::kCameraFrozen && i == 6;  // the picture it freezes at
      EXPECT_EQ(same, first || i < 6 || i >= 10) << info.name << " " << i;
      off += same ? 0 : 1;
    }
    EXPECT_GE(off, 3) << info.name;
  }
}

TEST(Faults, AreReadFromTextOrRefused) {
  for (const FaultInfo& info : all_faults()) {
    const auto fault = fault_from(std::string(info.name) + "@12.5:0.25");
    ASSERT_TRUE(fault) << info.name;
    EXPECT_EQ(fault->kind, info.kind);
    EXPECT_EQ(fault->from_s, 12.5);
    EXPECT_EQ(fault->duration_s, 0.25);
    EXPECT_EQ(fault_from(std::string(info.name) + "@3")->duration_s, info.usual_duration_s);
  }
  for (const char* wrong : {"", "imu-silent", "imu-silent@", "imu-silent@x", "imu-silent@1:", "imu-silent@1:-2",
                            "silent@1", "imu-silent@nan", "imu-silent@1:2:3"}) {
    const auto fault = fault_from(wrong);
    ASSERT_FALSE(fault) << wrong;
    EXPECT_NE(fault.error().text().find("--fault"), std::string::npos);
  }
}

}  // namespace
}  // namespace epiline
