// IioImu against the kernel's HID sensor drivers: what goes into the virtual IMU must come out.
#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "drivers/program/hil/uhid_imu.h"
#include "drivers/sensors/imu/iio_imu.h"
#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/hardware/gpio_support.h"

namespace epiline {
namespace {

constexpr Span kWait = Span::from_milliseconds(30'000);
constexpr std::int64_t kInterval_ns = 5'000'000;

ImuDeviceConfig hub_config() {
  ImuDeviceConfig config;
  config.device = "gyro_3d";
  config.device_accel = "accel_3d";
  config.rate_hz = 200;
  return config;
}

/// Readings that are functions of time.
std::array<double, 3> rate_at(double t_s) { return {std::sin(t_s), -0.5 * std::cos(2 * t_s), 0.1 * t_s}; }
std::array<double, 3> force_at(double t_s) { return {1 + 2 * t_s, -3 * t_s, 9.81 - 0.5 * t_s}; }

/// Sends readings at their times until told to end.
class Player {
 public:
  /// `device_ns`: the hub's time of the first reading; 0: it has none.
  Player(UhidImu& imu, std::int64_t device_ns)
      : again_(std::make_unique<Again>(1e9 / kInterval_ns, [this, &imu, device_ns](std::int64_t) {
          const std::int64_t t_ns = kInterval_ns * played_++;
          if (skip_ > 0) {
            --skip_;
            return;
          }
          const double t_s = static_cast<double>(t_ns) * 1e-9;
          // the accelerometer's times lie between the gyroscope's
          imu.send_accelerometer({device_ns != 0 ? device_ns + t_ns - 2'000'000 : 0}, force_at(t_s - 0.002));
          imu.send_gyroscope({device_ns != 0 ? device_ns + t_ns : 0}, rate_at(t_s));
        })) {}
  void end() { again_.reset(); }
  void leave_out(int count) { skip_ = count; }

 private:
  std::int64_t played_ = 0;
  std::atomic<int> skip_{0};
  std::unique_ptr<Again> again_;
};

void plug_in(UhidImu& hub) {
  const Status status = hub.plug_in();
  ASSERT_TRUE(status) << status.error().text();
}
/// Reads `wanted` samples.
std::vector<ImuSample> read_some(IioImu& imu, std::size_t wanted) {
  std::vector<ImuSample> all;
  std::array<ImuSample, 16> samples;
  const std::int64_t until_ns = monotonic_ns() + kWait.ns;
  while (all.size() < wanted && monotonic_ns() < until_ns) {
    std::size_t count = 0;
    imu.read(samples, count, Span::from_milliseconds(100));
    all.insert(all.end(), samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(count));
  }
  EXPECT_GE(all.size(), wanted);
  return all;
}

/// Reads until that fails.
bool fails(IioImu& imu) {
  std::array<ImuSample, 16> samples;
  std::size_t count = 0;
  return within(30, [&] { return imu.read(samples, count, Span::from_milliseconds(100)) == ReadOutcome::kFailed; });
}

std::string attribute(const std::string& device, const std::string& name) {
  return first_line("/sys/bus/iio/devices/" + device + "/" + name);
}

TEST(IioImuOfTheKernel, ReadingsComeOutAtTheGyroscopesTimes) {
  UhidImu hub;
  plug_in(hub);
  IioImu imu(hub_config());
  ASSERT_OPENS(imu);
  EXPECT_TRUE(hub.is_on());
  EXPECT_EQ(hub.interval_ms(), 5);
  EXPECT_EQ(imu.rate_hz(), 200);
  const std::int64_t device_ns = 1'403'636'579'758'555'392;  // a recording's clock
  Player player(hub, device_ns);
  const std::vector<ImuSample> samples = read_some(imu, 200);
  EXPECT_EQ(imu.clock(), IioClock::kDevice);
  EXPECT_GT(imu.clock_state().used, 100u);
  const std::int64_t offset_ns = imu.clock_state().offset.ns + device_ns;
  HostStamp last;
  for (const ImuSample& sample : samples) {
    EXPECT_GT(sample.stamp, last);
    EXPECT_GE(sample.arrival, sample.stamp);
    last = sample.stamp;
    // which reading it is, says its value
    const double t_s = std::round(10 * sample.angular_velocity_rad_s[2] * 200) / 200;
    EXPECT_NEAR(static_cast<double>(sample.stamp.ns - offset_ns) * 1e-9, t_s, 0.05) << "the model has learned since";
    const auto rate = rate_at(t_s), force = force_at(t_s);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(sample.angular_velocity_rad_s[i], rate[i], 0.6e-6);
      EXPECT_NEAR(sample.specific_force_m_s2[i], force[i], 1.1e-6) << "a straight line is interpolated exactly";
    }
  }
  const IioCounts counts = imu.counts();
  EXPECT_EQ(counts.samples, samples.size());
  EXPECT_EQ(counts.disconnected, 0u);
  EXPECT_EQ(counts.bad_stamps, 0u);
}

TEST(IioImuOfTheKernel, TheKernelsStampsAreTakenAsTheyAre) {
  UhidImu hub;
  plug_in(hub);
  ImuDeviceConfig config = hub_config();
  config.delay_ms = 1.5;
  IioImu imu(config);
  ASSERT_OPENS(imu);
  EXPECT_EQ(attribute(hub.gyroscope_device(), "current_timestamp_clock"), "monotonic");
  Player player(hub, 0);
  for (const ImuSample& sample : read_some(imu, 50)) {
    EXPECT_GE(sample.arrival - sample.stamp, Span{1'500'000});
    EXPECT_LT(sample.arrival - sample.stamp, Span::from_milliseconds(2'000));
  }
  EXPECT_EQ(imu.clock(), IioClock::kHost);
  EXPECT_EQ(imu.clock_state().status, ClockStatus::kEmpty);
}

TEST(IioImuOfTheKernel, MissingReadingsAreCounted) {
  UhidImu hub;
  plug_in(hub);
  IioImu imu(hub_config());
  ASSERT_OPENS(imu);
  Player player(hub, 7'000'000'000);
  read_some(imu, 40);
  const IioCounts before = imu.counts();
  player.leave_out(7);
  read_some(imu, 40);
  player.end();
  std::array<ImuSample, 16> rest;
  std::size_t count = 1;
  while (imu.read(rest, count, Span::from_milliseconds(100)) == ReadOutcome::kSample) {
  }
  const IioCounts after = imu.counts();
  EXPECT_EQ(after.gaps - before.gaps, 1u);
  EXPECT_EQ(after.lost - before.lost, 7u);
}

TEST(IioImuOfTheKernel, ReadingUsesNoHeapAndNoLocks) {
  UhidImu hub;
  plug_in(hub);
  IioImu imu(hub_config());
  ASSERT_OPENS(imu);
  Player player(hub, 7'000'000'000);
  std::array<ImuSample, 16> samples;
  std::size_t count = 0, all = 0;
  const HeapCallScope heap;
  const std::uint64_t locks = lock_calls_of_this_thread();
  for (int i = 0; i < 5'000 && all < 100; ++i) {
    imu.read(samples, count, Span::from_milliseconds(10));
    all += count;
  }
  EXPECT_EQ(heap.calls(), 0u);
  EXPECT_EQ(lock_calls_of_this_thread() - locks, 0u);
  EXPECT_GE(all, 100u);
}

TEST(IioImuOfTheKernel, ClosingLeavesTheDeviceAsItWas) {
  UhidImu hub;
  plug_in(hub);
  const std::vector<std::string> names{"buffer/enable",
                                       "buffer/length",
                                       "buffer/watermark",
                                       "current_timestamp_clock",
                                       "trigger/current_trigger",
                                       "scan_elements/in_timestamp_en",
                                       "in_anglvel_sampling_frequency",
                                       "scan_elements/in_anglvel_x_en",
                                       "scan_elements/in_anglvel_z_en"};
  const std::string sys = "/sys/bus/iio/devices/" + hub.gyroscope_device() + "/";
  write_file(sys + "in_anglvel_sampling_frequency", "50");
  write_file(sys + "current_timestamp_clock", "realtime");
  write_file(sys + "scan_elements/in_anglvel_z_en", "1");
  std::vector<std::string> before, during, after;
  const auto look = [&](std::vector<std::string>& values) {
    for (const std::string& name : names) values.push_back(attribute(hub.gyroscope_device(), name));
  };
  look(before);
  {
    IioImu imu(hub_config());
    ASSERT_OPENS(imu);
    look(during);
  }
  look(after);
  EXPECT_EQ(after, before);
  EXPECT_EQ(during[0], "1");
  EXPECT_EQ(during[3], "monotonic");
  EXPECT_EQ(during[6], "200.000000");
  EXPECT_EQ(during[7], "1");
}

TEST(IioImuOfTheKernel, WhatABadEndLeftOnIsSwitchedOff) {
  UhidImu hub;
  plug_in(hub);
  const std::string sys = "/sys/bus/iio/devices/" + hub.gyroscope_device() + "/";
  write_file(sys + "scan_elements/in_anglvel_x_en", "1");
  write_file(sys + "buffer/enable", "1");
  {
    IioImu imu(hub_config());
    ASSERT_OPENS(imu);
    Player player(hub, 0);
    read_some(imu, 10);
  }
  EXPECT_EQ(attribute(hub.gyroscope_device(), "buffer/enable"), "0");
}

TEST(IioImuOfTheKernel, SaysWhichRateItHasAndWhoReadsIt) {
  UhidImu hub;
  plug_in(hub);
  ImuDeviceConfig config = hub_config();
  config.rate_hz = 400;  // the hub counts whole milliseconds
  EXPECT_EQ(error_of_opening(IioImu(config)),
            "imu.device gyro_3d: in_anglvel_sampling_frequency is 500 Hz after setting 400 [rate]; expected "
            "a rate that it has in imu.rate_hz");
  IioImu first(hub_config());
  ASSERT_OPENS(first);
  EXPECT_EQ(error_of_opening(IioImu(hub_config())),
            "imu.device gyro_3d: another program reads it [open]; expected no other reader: the kernel allows one");
}

TEST(IioImuOfTheKernel, DevicesAreFoundByPathAndTheTriggerIsChosen) {
  UhidImu hub;
  plug_in(hub);
  const std::string own = attribute(hub.gyroscope_device(), "trigger/current_trigger");
  ASSERT_FALSE(own.empty());
  write_file("/sys/bus/iio/devices/" + hub.gyroscope_device() + "/trigger/current_trigger", "\n");
  ASSERT_EQ(attribute(hub.gyroscope_device(), "trigger/current_trigger"), "");
  ImuDeviceConfig config = hub_config();
  config.device = "/dev/" + hub.gyroscope_device();
  config.device_accel = "/sys/bus/iio/devices/" + hub.accelerometer_device();
  IioImu imu(config);
  ASSERT_OPENS(imu);
  EXPECT_EQ(attribute(hub.gyroscope_device(), "trigger/current_trigger"), own);
  Player player(hub, 0);
  read_some(imu, 10);
}

TEST(IioImuOfTheKernel, AnUnpluggedImuComesBackWhenPlugged) {
  UhidImu hub;
  plug_in(hub);
  IioImu imu(hub_config());
  ASSERT_OPENS(imu);
  Player player(hub, 0);
  read_some(imu, 20);
  std::atomic<std::int64_t> plugged_ns{0};
  std::thread hand([&] {
    hub.unplug();
    std::this_thread::sleep_for(std::chrono::milliseconds(2'500));
    plug_in(hub);
    plugged_ns = monotonic_ns();
  });
  EXPECT_TRUE(fails(imu));
  EXPECT_FALSE(imu.is_streaming());
  EXPECT_EQ(imu.counts().last_error, ENODEV);
  std::array<ImuSample, 16> samples;
  std::size_t count = 0;
  ReadOutcome outcome = ReadOutcome::kFailed;
  int failures = 0;
  {
    const HeapCallScope heap;
    for (int i = 0; i < 300 && outcome != ReadOutcome::kSample; ++i) {
      outcome = imu.read(samples, count, Span::from_milliseconds(100));
      failures += outcome == ReadOutcome::kFailed;
    }
    EXPECT_EQ(heap.calls(), 0u);
  }
  ASSERT_EQ(outcome, ReadOutcome::kSample);
  const std::int64_t back_ns = monotonic_ns();
  hand.join();
  std::printf("plugged in: readings after %.0f ms, %llu attempts before\n",
              static_cast<double>(back_ns - plugged_ns) * 1e-6, static_cast<unsigned long long>(imu.counts().retries));
  EXPECT_LT(back_ns - plugged_ns, 2'000'000'000);
  EXPECT_GT(failures, 3);
  EXPECT_EQ(imu.counts().disconnected, 1u);
  read_some(imu, 50);
}

TEST(IioImuOfTheKernel, ASilentImuIsOpenedAnew) {
  UhidImu hub;
  plug_in(hub);
  IioImu imu(hub_config());
  ASSERT_OPENS(imu);
  {
    Player player(hub, 0);
    read_some(imu, 10);
  }
  EXPECT_TRUE(fails(imu));
  EXPECT_EQ(imu.counts().last_error, 0);
  Player player(hub, 0);
  read_some(imu, 10);
}

}  // namespace
}  // namespace epiline
