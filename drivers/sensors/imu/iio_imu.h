#pragma once
// An IMU with a driver of Linux' industrial I/O (IIO): one device with both sensors, or one for each. docs/imu.md
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "drivers/sensors/imu/accel_merge.h"
#include "drivers/sensors/imu/iio_device.h"
#include "pipeline/config/devices.h"
#include "platform/concurrency/snapshot.h"
#include "platform/ports/counter.h"
#include "platform/ports/ports.h"
#include "platform/time/backoff.h"
#include "platform/time/interval_tracker.h"
#include "platform/time/one_way_sync.h"

namespace epiline {

/// Counters of samples and of the device.
struct IioCounts {
  std::uint64_t samples = 0;        ///< samples delivered
  std::uint64_t gaps = 0;           ///< gaps in the timestamps ...
  std::uint64_t lost = 0;           ///< ... and the number of missing samples
  std::uint64_t disordered = 0;     ///< left out: not later than the previous one
  std::uint64_t bad_stamps = 0;     ///< left out: no clock, a wrong time, or contradicting the device's clock
  std::uint64_t without_accel = 0;  ///< left out: gyroscope samples without accelerometer samples around them
  std::uint64_t disconnected = 0;   ///< the device was lost
  std::uint64_t retries = 0;        ///< failed attempts to reopen it
  int last_error = 0;               ///< errno of the last loss or failed attempt; 0: it was silent, or not as before
};
inline constexpr auto kIioCounters = std::to_array<Counter<IioCounts>>({
    {"readings", &IioCounts::samples},
    {"gaps", &IioCounts::gaps, true},
    {"lost", &IioCounts::lost, true},
    {"disordered", &IioCounts::disordered, true},
    {"bad_stamps", &IioCounts::bad_stamps, true},
    {"without_accel", &IioCounts::without_accel},
    {"disconnected", &IioCounts::disconnected, true},
    {"retries", &IioCounts::retries},
});

/// The clock of the timestamps.
enum class IioClock : std::uint8_t {
  kUnknown,  ///< no reading yet
  kHost,     ///< the kernel's: CLOCK_MONOTONIC
  kDevice,   ///< the sensor's own (HID sensors with a sample time): translated, see clock_state()
};

/// One thread calls open(), read() and close(); any thread may call counts(). After open() there is no heap call, also
/// while the device is lost; a read() that reopens it takes as long as the kernel needs.
class IioImu final : public ImuSource {
 public:
  explicit IioImu(ImuDeviceConfig config, IioRoots roots = {});
  ~IioImu() override { close(); }

  /// The error names the fault of the device or the settings.
  Status open() override;
  void close() noexcept override;
  /// An accelerometer in a device of its own is interpolated at the gyroscope's times.
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override;

  IioCounts counts() const noexcept { return shown_counts_.read(); }
  bool is_streaming() const noexcept { return streaming_.load(std::memory_order_relaxed); }
  IioClock clock() const noexcept { return clock_.load(std::memory_order_relaxed); }
  /// kEmpty unless clock() is kDevice.
  ClockState clock_state() const noexcept { return shown_clock_state_.read(); }
  /// Samples per second, as the device reports; 0: unknown.
  double rate_hz() const noexcept { return rate_hz_.load(std::memory_order_relaxed); }

 private:
  /// A reading of the gyroscope that waits for the accelerometer's. Times are the device's own or the host's, for both
  /// sensors the same.
  struct Gyro {
    DeviceStamp stamp;
    HostStamp arrival;
    std::array<double, 3> angular_velocity_rad_s{}, specific_force_m_s2{};
  };
  /// What is known of one sensor's stream since the device was opened.
  struct Stream {
    DeviceStamp newest;
    bool has_newest = false;
    IntervalTracker interval;
    int wrong_in_row = 0;
    std::int64_t last_ns = 0;  ///< when it last gave something
  };
  static constexpr std::size_t kPending = 512;
  static_assert(kPending / 2 >= IioDevice::kMostReadings, "room for what one look gives");

  /// For another look at the gyroscope. Without, its readings stay in the kernel until the accelerometer's come.
  bool has_room() const noexcept { return pending_count_ < kPending / 2; }
  bool has_two() const noexcept { return !config_.device_accel.empty() && config_.device_accel != config_.device; }
  DeviceTrouble set_up() noexcept;
  void lose(int error) noexcept;
  bool reopen() noexcept;

  ReadOutcome read_some(std::span<ImuSample> samples, std::size_t& count, HostStamp deadline) noexcept;
  int take(IioDevice& device, Stream& stream) noexcept;
  bool knows_time(std::span<const IioReading> readings, HostStamp arrival) noexcept;
  bool is_next(DeviceStamp stamp, HostStamp arrival, Stream& stream) noexcept;
  void keep(const IioReading& reading, HostStamp arrival) noexcept;
  void drop_oldest() noexcept;
  bool next(ImuSample& sample) noexcept;
  bool wait(Span at_most) noexcept;
  bool is_silent() const noexcept;

  ImuDeviceConfig config_;
  IioRoots roots_;
  IioDevice gyro_, accel_;
  bool opened_ = false;
  std::array<IioReading, IioDevice::kMostReadings> readings_{};
  Stream gyro_stream_, accel_stream_;
  std::array<Gyro, kPending> pending_{};
  std::size_t first_ = 0, pending_count_ = 0;
  AccelMerge<DeviceClock> merge_{Span{0}};
  OneWaySync sync_{{}};
  int undecided_ = 0;
  HostStamp last_out_;
  Backoff retry_{Span::from_milliseconds(50), Span::from_milliseconds(500)};
  IioCounts counts_;

  Snapshot<IioCounts> shown_counts_;
  Snapshot<ClockState> shown_clock_state_;
  std::atomic<bool> streaming_{false};
  std::atomic<IioClock> clock_{IioClock::kUnknown};
  std::atomic<double> rate_hz_{0};
};

}  // namespace epiline
