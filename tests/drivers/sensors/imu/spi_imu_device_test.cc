#include "drivers/sensors/imu/spi_imu_device.h"

#include <gtest/gtest.h>

#include <cerrno>

#include "platform/memory/allocation_count.h"

namespace epiline {
namespace {

TEST(SpiImuDevice, IsTheChipOfTheConfiguration) {
  ImuDeviceConfig config;
  config.device = "/dev/spidev-that-is-not-there";
  config.device_accel = "/dev/another-that-is-not-there";
  for (const ImuDriver driver : {ImuDriver::kIcm42688p, ImuDriver::kBmi088, ImuDriver::kAdis16470}) {
    config.driver = static_cast<int>(driver);
    const std::unique_ptr<SpiImu> imu = make_spi_imu(config);
    ASSERT_TRUE(imu);
    const Status status = imu->open();
    ASSERT_FALSE(status);
    const std::string told = status.error().text();
    EXPECT_NE(told.find("No such file or directory"), std::string::npos) << told;
    EXPECT_NE(told.find("spidev"), std::string::npos) << told;
  }
  config.driver = static_cast<int>(ImuDriver::kIio);
  EXPECT_EQ(make_spi_imu(config), nullptr);
}

// In flight it is opened again and again, until the adapter is back.
TEST(SpiImuDevice, OpeningWhatIsNotThereNeedsNoHeap) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  SpidevBus bus("/dev/spidev-that-is-not-there");
  const HeapCallScope heap;
  const DeviceTrouble trouble = bus.open(0, 1'000'000);
  EXPECT_EQ(heap.calls(), 0U);
  EXPECT_EQ(trouble.error, ENOENT);
}

TEST(SpiImuDevice, AFileThatIsNoSpiDeviceIsNamed) {
  ImuDeviceConfig config;
  config.driver = static_cast<int>(ImuDriver::kIcm42688p);
  config.device = "/dev/null";
  const Status status = make_spi_imu(config)->open();
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().text().find("an SPI device, /dev/spidevB.C"), std::string::npos) << status.error().text();
}

}  // namespace
}  // namespace epiline
