// On a folder that looks like sysfs.
#include "drivers/sensors/height/iio_pressure.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "platform/memory/allocation_count.h"
#include "platform/time/monotonic.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Pressure : public testing::Test {
 protected:
  Pressure() { fs::remove_all(root_); }
  ~Pressure() override { fs::remove_all(root_); }

  void put(const std::string& device, const std::string& file, const std::string& text) const {
    fs::create_directories(root_ / device);
    std::ofstream(root_ / device / file) << text << "\n";
  }
  void bmp280(const std::string& kpa) const {
    put("iio:device1", "name", "bmp280");
    put("iio:device1", "in_pressure_input", kpa);
  }
  IioPressure pressure(const std::string& device = "") const {
    return IioPressure({.device = device, .rate_hz = 200, .air_deg = 15, .devices = root_});
  }
  std::string error(const std::string& device = "") const {
    IioPressure p = pressure(device);
    const Status status = p.open();
    return status ? "opened" : status.error().text();
  }
  /// The next height; NaN: none.
  static double height(IioPressure& p) {
    HeightSample sample;
    return p.read(sample, Span::from_milliseconds(60'000)) == ReadOutcome::kSample ? sample.metres : NAN;
  }

  const fs::path root_ = fs::path(testing::TempDir()) / ("pressure_" + std::to_string(getpid()));
};

TEST_F(Pressure, BecomesAHeightOfItsTime) {
  bmp280("101.325000000");
  IioPressure p = pressure();
  ASSERT_TRUE(p.open());
  HeightSample sample;
  const std::int64_t before_ns = monotonic_ns();
  ASSERT_EQ(p.read(sample, Span::from_milliseconds(60'000)), ReadOutcome::kSample);
  EXPECT_EQ(sample.kind, HeightKind::kBarometer);
  EXPECT_NEAR(sample.metres, 0, 1e-9);
  EXPECT_GE(sample.stamp.ns, before_ns);
  EXPECT_LE(sample.stamp.ns, monotonic_ns());
  bmp280("100.129000000");  // a hundred metres in the standard atmosphere
  EXPECT_NEAR(height(p), 100, 0.3);
  EXPECT_EQ(p.counts().heights, 2u);
}

TEST_F(Pressure, OfAChipWithARawValueHasScaleAndOffset) {
  put("iio:device0", "name", "lps22hb");
  put("iio:device0", "in_pressure_raw", "4149072");
  put("iio:device0", "in_pressure_scale", "0.000024414");
  put("iio:device0", "in_pressure_offset", "1200");
  IioPressure p = pressure();
  ASSERT_TRUE(p.open());
  EXPECT_NEAR(height(p), 0, 0.3);  // (4149072 + 1200) x 0.000024414 kPa = 1013.25 hPa
}

TEST_F(Pressure, IsFoundByNameOrPathAndElseSaysWhatIsThere) {
  EXPECT_THAT(error(), HasSubstr("height.device is not set; expected a barometer with an IIO driver; present: none"));
  put("iio:device0", "name", "icm42605");
  bmp280("101.3");
  EXPECT_EQ(error(), "opened");
  put("iio:device2", "name", "ms5611");
  put("iio:device2", "in_pressure_input", "101.2");
  EXPECT_THAT(error(), HasSubstr("expected one of iio:device1 (bmp280), iio:device2 (ms5611)"));
  for (const std::string device : {"ms5611", "iio:device2", "/dev/iio:device2"}) EXPECT_EQ(error(device), "opened");
  EXPECT_THAT(error("bmp390"),
              HasSubstr("height.device = \"bmp390\"; expected a barometer with an IIO driver; present: iio:device1"));
}

TEST_F(Pressure, WhatNoAirHasIsRefused) {
  bmp280("101.3");
  IioPressure p = pressure();
  ASSERT_TRUE(p.open());
  for (const char* kpa : {"0", "9.9", "121", "nan", "", "bar"}) {
    bmp280(kpa);
    EXPECT_TRUE(std::isnan(height(p))) << kpa;
  }
  EXPECT_EQ(p.counts().refused_values, 6u);
  bmp280("101.3");
  EXPECT_FALSE(std::isnan(height(p)));
}

TEST_F(Pressure, AChipThatIsLostIsAskedAgain) {
  bmp280("101.3");
  IioPressure p = pressure();
  ASSERT_TRUE(p.open());
  ASSERT_FALSE(std::isnan(height(p)));
  p.close();  // as after a failed reading
  fs::remove_all(root_);
  HeightSample sample;
  EXPECT_EQ(p.read(sample, Span::from_milliseconds(60'000)), ReadOutcome::kFailed);
  bmp280("101.3");
  EXPECT_FALSE(std::isnan(height(p)));
  EXPECT_EQ(p.counts().failed, 1u);
}

TEST_F(Pressure, NeedsNoHeapAndKeepsItsRate) {
  bmp280("101.3");
  IioPressure p = pressure();
  ASSERT_TRUE(p.open());
  const std::int64_t begin_ns = monotonic_ns();
  const HeapCallScope heap;
  HeightSample sample;
  for (int i = 0; i < 21; ++i) ASSERT_EQ(p.read(sample, Span::from_milliseconds(60'000)), ReadOutcome::kSample);
  EXPECT_EQ(heap.calls(), 0u);
  EXPECT_GE(monotonic_ns() - begin_ns, 100'000'000) << "twenty periods of 5 ms";
}

}  // namespace
}  // namespace epiline
