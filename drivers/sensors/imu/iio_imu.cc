#include "drivers/sensors/imu/iio_imu.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/sensors/trouble.h"
#include "platform/error/contract.h"
#include "platform/linux/system_calls.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kSilence = Span::from_milliseconds(2'000);  // after this time without a sample, the device is reopened
constexpr Span kLook = Span::from_milliseconds(20);        // read() fails for an unplugged device, poll() does not
// The kernel stamps a sample shortly before we get it.
constexpr Span kAhead = Span::from_milliseconds(1), kFresh = Span::from_milliseconds(500);
constexpr Span kOld = Span::from_milliseconds(2'000);
constexpr int kDecide = 3;           // timestamps in a row off the host's clock: the device has its own
constexpr int kWrongMost = 20;       // readings in a row that cannot be used: begin anew
constexpr double kGapOfAccel = 3.5;  // usual intervals without the accelerometer that are bridged

HostStamp now() noexcept { return {monotonic_ns()}; }

}  // namespace

IioImu::IioImu(ImuDeviceConfig config, IioRoots roots) : config_(std::move(config)), roots_(roots) {}

// ---- setting up, losing, getting back ----

Status IioImu::open() {
  close();
  counts_ = {};
  shown_counts_.write(counts_);
  if (const DeviceTrouble trouble = set_up()) {
    const bool is_accel = gyro_.is_open();
    gyro_.close();
    return error_of(trouble, is_accel ? "imu.device_accel " + config_.device_accel : "imu.device " + config_.device);
  }
  opened_ = true;
  return Done{};
}

void IioImu::close() noexcept {
  streaming_.store(false, std::memory_order_relaxed);
  gyro_.close();
  accel_.close();
  opened_ = false;
}

/// If it fails, gyro_ is open if and only if the accelerometer's device is to blame.
DeviceTrouble IioImu::set_up() noexcept {
  IioRequest request{config_.device.c_str(), true, !has_two(), config_.rate_hz, config_.trigger.c_str()};
  if (const DeviceTrouble trouble = gyro_.open(roots_, request)) return trouble;
  if (has_two()) {
    request.device = config_.device_accel.c_str();
    request.gyroscope = false;
    request.accelerometer = true;
    if (const DeviceTrouble trouble = accel_.open(roots_, request)) return trouble;
    if (std::strcmp(gyro_.hub().c_str(), accel_.hub().c_str()) != 0) {
      accel_.close();
      return unexpected("two devices", "both sensors of one hub, because they need one clock",
                        "the accelerometer belongs to another sensor hub than the gyroscope");
    }
  }
  const std::int64_t now_ns = monotonic_ns();
  const auto stream = [&](const IioDevice& device) {
    Stream fresh;
    if (device.rate_hz() > 0) fresh.interval = IntervalTracker(1e9 / device.rate_hz());
    fresh.last_ns = now_ns;
    return fresh;
  };
  gyro_stream_ = stream(gyro_);
  accel_stream_ = stream(accel_);
  first_ = pending_count_ = 0;
  merge_.restart(Span{0});
  sync_ = OneWaySync({});
  undecided_ = 0;
  clock_.store(IioClock::kUnknown, std::memory_order_relaxed);
  rate_hz_.store(gyro_.rate_hz(), std::memory_order_relaxed);
  streaming_.store(true, std::memory_order_relaxed);
  return {};
}

void IioImu::lose(int error) noexcept {
  streaming_.store(false, std::memory_order_relaxed);
  gyro_.close();
  accel_.close();
  ++counts_.disconnected;
  counts_.last_error = error;
  retry_.begin(monotonic_ns());
}

bool IioImu::reopen() noexcept {
  const DeviceTrouble trouble = set_up();
  if (!trouble) return true;
  gyro_.close();
  ++counts_.retries;
  counts_.last_error = trouble.error;
  retry_.failed(monotonic_ns());
  return false;
}

// ---- readings ----

ReadOutcome IioImu::read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept {
  EPILINE_EXPECTS(opened_, "open() before read()");
  count = 0;
  const ReadOutcome outcome = read_some(samples, count, now() + timeout);
  counts_.samples += count;
  shown_counts_.write(counts_);
  return outcome;
}

ReadOutcome IioImu::read_some(std::span<ImuSample> samples, std::size_t& count, HostStamp deadline) noexcept {
  if (!is_streaming()) {
    const std::int64_t now_ns = monotonic_ns();
    if (now_ns < retry_.due_ns()) {
      wait({std::min(retry_.due_ns(), deadline.ns) - now_ns});
      if (monotonic_ns() < retry_.due_ns()) return ReadOutcome::kFailed;
    }
    if (!reopen()) return ReadOutcome::kFailed;
  }
  for (bool is_well = true;;) {
    int error = has_room() ? take(gyro_, gyro_stream_) : 0;
    if (error == 0 && has_two()) error = take(accel_, accel_stream_);
    while (count < samples.size() && next(samples[count])) ++count;
    if (count > 0) return ReadOutcome::kSample;
    if (error == 0 && !is_well) error = EIO;
    const bool is_wrong = std::max(gyro_stream_.wrong_in_row, accel_stream_.wrong_in_row) >= kWrongMost;
    if (error != 0 || is_wrong || is_silent()) {
      lose(error);
      return ReadOutcome::kFailed;
    }
    const HostStamp instant = now();
    if (instant >= deadline) return ReadOutcome::kTimeout;
    is_well = wait(deadline - instant);
  }
}

/// 0, or why the device is lost.
int IioImu::take(IioDevice& device, Stream& stream) noexcept {
  std::size_t count = 0;
  const int error = device.read(readings_, count);
  if (error != 0) return error == EAGAIN ? 0 : error;
  const HostStamp arrival = now();
  stream.last_ns = arrival.ns;
  const std::span<const IioReading> readings(readings_.data(), count);
  const bool is_gyro = &device == &gyro_;
  if (is_gyro && !knows_time(readings, arrival)) return 0;
  for (const IioReading& reading : readings) {
    const DeviceStamp stamp{reading.stamp_ns};
    if (is_gyro && reading.stamp_ns > readings.back().stamp_ns) {  // only the last one's time was judged
      ++counts_.bad_stamps;
      ++stream.wrong_in_row;
      continue;
    }
    if (!is_next(stamp, arrival, stream)) continue;
    if (is_gyro)
      keep(reading, arrival);
    else
      merge_.add(stamp, reading.specific_force_m_s2);
  }
  return 0;
}

/// Whose time it is: the host's, if the newest reading is fresh; of what is older, the buffer tells nothing. The clock
/// of a device is learned from the newest reading, which waited least.
bool IioImu::knows_time(std::span<const IioReading> readings, HostStamp arrival) noexcept {
  const DeviceStamp newest{readings.back().stamp_ns};
  const bool is_time = is_clock_time(newest);
  const Span age{is_time ? arrival.ns - newest.ns : 0};
  if (clock() == IioClock::kUnknown && is_time) {
    const bool is_host = age >= -kAhead && age <= kFresh;
    if (is_host)
      clock_.store(IioClock::kHost, std::memory_order_relaxed);
    else if (++undecided_ < kDecide)
      return false;
    else
      clock_.store(IioClock::kDevice, std::memory_order_relaxed);
  }
  bool is_good = is_time;
  if (clock() == IioClock::kHost) {
    is_good = is_good && age >= -kAhead && age <= kOld;
  } else if (clock() == IioClock::kDevice) {
    const ClockOutcome outcome = sync_.update(newest, arrival);
    is_good = outcome != ClockOutcome::kContradicts && outcome != ClockOutcome::kRefused;
    shown_clock_state_.write(sync_.state());
  }
  if (is_good) return true;
  counts_.bad_stamps += readings.size();
  gyro_stream_.wrong_in_row += static_cast<int>(readings.size());
  return false;
}

bool IioImu::is_next(DeviceStamp stamp, HostStamp arrival, Stream& stream) noexcept {
  const bool is_of_host = clock() == IioClock::kHost;
  if (!is_clock_time(stamp) || (is_of_host && stamp.ns > (arrival + kAhead).ns)) {
    ++counts_.bad_stamps;
    ++stream.wrong_in_row;
    return false;
  }
  if (stream.has_newest && stamp <= stream.newest) {
    ++counts_.disordered;
    ++stream.wrong_in_row;
    return false;
  }
  if (stream.has_newest) {
    const std::uint64_t missing = stream.interval.note((stamp - stream.newest).ns);
    if (missing > 0 && &stream == &gyro_stream_) {
      ++counts_.gaps;
      counts_.lost += missing;
    }
  }
  stream.newest = stamp;
  stream.has_newest = true;
  stream.wrong_in_row = 0;
  return true;
}

void IioImu::keep(const IioReading& reading, HostStamp arrival) noexcept {
  pending_[(first_ + pending_count_++) % kPending] = {
      {reading.stamp_ns}, arrival, reading.angular_velocity_rad_s, reading.specific_force_m_s2};
}

void IioImu::drop_oldest() noexcept {
  first_ = (first_ + 1) % kPending;
  --pending_count_;
}

bool IioImu::next(ImuSample& sample) noexcept {
  using Outcome = AccelMerge<DeviceClock>::Outcome;
  while (pending_count_ > 0) {
    Gyro& gyro = pending_[first_];
    if (has_two()) {
      const Span longest{static_cast<std::int64_t>(kGapOfAccel * accel_stream_.interval.usual_ns())};
      merge_.set_longest_gap(longest);
      const Outcome outcome = merge_.value_at(gyro.stamp, gyro.specific_force_m_s2);
      if (outcome == Outcome::kWait) return false;
      if (outcome == Outcome::kNever) {
        ++counts_.without_accel;
        drop_oldest();
        continue;
      }
    }
    const Gyro taken = gyro;
    drop_oldest();
    const HostStamp host = clock() == IioClock::kDevice ? sync_.translate(taken.stamp) : HostStamp{taken.stamp.ns};
    sample = {};
    sample.stamp = host - Span{static_cast<std::int64_t>(config_.delay_ms * 1e6)};
    if (sample.stamp <= last_out_) {
      ++counts_.disordered;
      continue;
    }
    last_out_ = sample.stamp;
    sample.angular_velocity_rad_s = taken.angular_velocity_rad_s;
    sample.specific_force_m_s2 = taken.specific_force_m_s2;
    sample.arrival = taken.arrival;
    return true;
  }
  return false;
}

bool IioImu::is_silent() const noexcept {
  const std::int64_t oldest_ns =
      has_two() ? std::min(gyro_stream_.last_ns, accel_stream_.last_ns) : gyro_stream_.last_ns;
  return monotonic_ns() - oldest_ns > kSilence.ns;
}

/// Until a device has readings or it is time to look at it. False: a device reports an error.
bool IioImu::wait(Span at_most) noexcept {
  // -1 is passed over. A gyroscope whose readings have to stay in the kernel would end every wait at once.
  std::array<pollfd, 2> fds{{{has_room() ? gyro_.fd() : -1, POLLIN, 0}, {accel_.fd(), POLLIN, 0}}};
  SystemCalls::of_this_computer().wait(fds, is_streaming() ? std::min(at_most, kLook) : at_most);
  return ((fds[0].revents | fds[1].revents) & (POLLERR | POLLHUP | POLLNVAL)) == 0;
}

}  // namespace epiline
