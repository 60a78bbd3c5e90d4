#include "drivers/program/hil/uhid_imu.h"

#include <fcntl.h>
#include <linux/uhid.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "platform/time/monotonic.h"

namespace epiline {

namespace fs = std::filesystem;

namespace {

// ---- the report descriptor: HID Usage Tables 1.12, chapter 16 (sensors) ----

constexpr std::array<std::uint8_t, 2> kSensorReport{1, 2};  // report identifiers: gyroscope, accelerometer
constexpr std::uint8_t kGyrometer3d = 0x76, kAccelerometer3d = 0x73;
constexpr int kAngularVelocityX = 0x457, kAccelerationX = 0x453;  // y and z follow
constexpr int kRadiansPerSecond = 0x12F0, kMetresPerSecondSquared = 0x11E0, kMilliseconds = 0x19;
constexpr int kReportInterval = 0x30E, kReportingState = 0x316, kNoEvents = 0x840;
constexpr int kPowerState = 0x319, kPowerUndefined = 0x850, kSampleTime = 0x529;
// The kernel counts a list's states from 1.
constexpr std::uint8_t kNoEventsState = 1, kAllEventsState = 2, kFullPowerState = 2, kPowerOffState = 6;
constexpr std::uint8_t kMicro = 0x0A;  // exponent -6, as 4 bits

struct Descriptor {
  std::array<std::uint8_t, 512> bytes{};
  std::size_t size = 0;
  constexpr void byte(int b) { bytes[size++] = static_cast<std::uint8_t>(b); }
  constexpr void item(int tag, int value) { byte(tag), byte(value); }
  constexpr void item16(int tag, int value) { byte(tag), byte(value & 255), byte(value >> 8); }
  constexpr void item32(int tag, std::uint32_t value) {
    byte(tag);
    for (int i = 0; i < 4; ++i) byte(static_cast<int>(value >> (8 * i) & 255));
  }
  constexpr void usage(int u) { item16(0x0A, u); }
  constexpr void field(int bits) { item(0x75, bits), item(0x95, 1); }
  constexpr void input() { item(0x81, 2); }
  constexpr void end_collection() { byte(0xC0); }
  /// A feature that is one of six states.
  constexpr void choice(int property, int first_state) {
    usage(property);
    item(0x15, 1), item(0x25, 6);
    field(8);
    item(0xA1, 2);
    for (int i = 0; i < 6; ++i) usage(first_state + i);
    item(0xB1, 0);
    end_collection();
  }
  constexpr void sensor(int report, int type, int first_axis, int unit) {
    item(0x05, 0x20), item(0x09, type), item(0xA1, 0), item(0x85, report);
    usage(kReportInterval);
    item(0x15, 0), item32(0x27, 0x7FFFFFFF);
    field(32);
    item(0x55, 0), item(0xB1, 2);
    choice(kReportingState, kNoEvents);
    choice(kPowerState, kPowerUndefined);
    item32(0x17, 0x80000000u), item32(0x27, 0x7FFFFFFF);
    for (int axis = 0; axis < 3; ++axis) {
      usage(first_axis + axis);
      field(32);
      item(0x55, kMicro), item16(0x66, unit);
      input();
    }
    usage(kSampleTime);
    field(64);
    item(0x55, kMicro), item(0x65, kMilliseconds);
    input();
    end_collection();
  }
};

constexpr Descriptor sensor_hub() {
  Descriptor d;
  d.item(0x05, 0x20), d.item(0x09, 1), d.item(0xA1, 0);
  d.sensor(kSensorReport[0], kGyrometer3d, kAngularVelocityX, kRadiansPerSecond);
  d.sensor(kSensorReport[1], kAccelerometer3d, kAccelerationX, kMetresPerSecondSquared);
  d.end_collection();
  return d;
}
constexpr Descriptor kHub = sensor_hub();

constexpr std::array kIioNames{"gyro_3d", "accel_3d"};
constexpr std::size_t kReportBytes = 1 + 3 * 4 + 8;

bool put(int fd, const uhid_event& event) noexcept {
  return ::write(fd, &event, sizeof(event)) == static_cast<ssize_t>(sizeof(event));
}

std::string text_in(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

Status UhidImu::open() {
  fd_ = ::open("/dev/uhid", O_RDWR | O_CLOEXEC | O_NONBLOCK);
  if (fd_ < 0)
    return Error{
        ErrorKind::kRun, "/dev/uhid", 0, std::strerror(errno),
        errno == ENOENT ? "the kernel module uhid (modprobe uhid)" : "write access to it (root, or a udev rule)"};
  answering_ = std::thread([this] { answer(); });
  return Done{};
}

UhidImu::~UhidImu() {
  unplug();
  ends_ = true;
  if (answering_.joinable()) answering_.join();
  if (fd_ >= 0) ::close(fd_);
}

Status UhidImu::create() {
  uhid_event event{};
  event.type = UHID_CREATE2;
  uhid_create2_req& request = event.u.create2;
  unique_ = "epiline-" + std::to_string(::getpid()) + "-" + std::to_string(monotonic_ns());
  std::strncpy(reinterpret_cast<char*>(request.name), "epiline virtual IMU", sizeof(request.name) - 1);
  std::strncpy(reinterpret_cast<char*>(request.uniq), unique_.c_str(), sizeof(request.uniq) - 1);
  request.bus = 3;          // USB
  request.vendor = 0x1209;  // for tests: pid.codes 1209:0001
  request.product = 1;
  request.rd_size = kHub.size;
  std::memcpy(request.rd_data, kHub.bytes.data(), kHub.size);
  if (!put(fd_, event)) return Error{ErrorKind::kRun, "/dev/uhid", 0, std::strerror(errno), "a new HID device"};
  return Done{};
}

Status UhidImu::plug_in() {
  unplug();
  if (fd_ < 0)
    if (Status status = open(); !status) return status;
  for (Sensor& sensor : sensors_) {
    sensor.device.clear();
    sensor.interval_ms = 0;
    sensor.is_on = false;
    sensor.feature = {0, 0, 0, 0, kNoEventsState, kPowerOffState};
  }
  if (Status status = create(); !status) return status;
  for (const std::int64_t until_ns = monotonic_ns() + 30'000'000'000; !find_devices();) {
    if (monotonic_ns() > until_ns) {
      unplug();
      return Error{ErrorKind::kRun, "virtual IMU", 0, "the kernel made no IIO devices of it",
                   "the kernel modules hid-sensor-gyro-3d and hid-sensor-accel-3d (modprobe)"};
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return Done{};
}

/// Refused, to no harm, if there is nothing to unplug.
void UhidImu::unplug() noexcept {
  if (fd_ < 0) return;
  uhid_event event{};
  event.type = UHID_DESTROY;
  put(fd_, event);
}

bool UhidImu::find_devices() {
  std::error_code ignored;  // devices come and go meanwhile
  for (const auto& entry : fs::directory_iterator("/sys/bus/iio/devices", ignored)) {
    const fs::path device = fs::canonical(entry.path(), ignored);
    const std::string name = text_in(device / "name");
    // .../HID/HID-SENSOR-200076.1.auto/iio:device0
    const std::string hub = text_in(device.parent_path().parent_path() / "uevent");
    if (hub.find("HID_UNIQ=" + unique_ + "\n") == std::string::npos) continue;
    for (std::size_t i = 0; i < kIioNames.size(); ++i)
      if (name == std::string(kIioNames[i]) + "\n") sensors_[i].device = device.filename().string();
  }
  return std::all_of(sensors_.begin(), sensors_.end(), [](const Sensor& sensor) {
    return !sensor.device.empty() && fs::exists("/dev/" + sensor.device);
  });
}

/// The kernel asks for features and sets them: interval, and what it wants of the sensor.
void UhidImu::answer() {
  while (!ends_) {
    pollfd poll_fd{fd_, POLLIN, 0};
    uhid_event question{}, reply{};
    if (::poll(&poll_fd, 1, 50) <= 0 || ::read(fd_, &question, sizeof(question)) <= 0) continue;
    const bool sets = question.type == UHID_SET_REPORT;
    if (!sets && question.type != UHID_GET_REPORT) continue;
    const int report = sets ? question.u.set_report.rnum : question.u.get_report.rnum;
    const auto found = std::find(kSensorReport.begin(), kSensorReport.end(), report);
    Sensor* const sensor = found == kSensorReport.end() ? nullptr : &sensors_[found - kSensorReport.begin()];
    if (sets) {
      reply.type = UHID_SET_REPORT_REPLY;
      reply.u.set_report_reply.id = question.u.set_report.id;
      if (sensor == nullptr || question.u.set_report.size < 1 + sensor->feature.size()) {
        reply.u.set_report_reply.err = EIO;
      } else {
        std::memcpy(sensor->feature.data(), question.u.set_report.data + 1, sensor->feature.size());
        std::int32_t interval_ms = 0;
        std::memcpy(&interval_ms, sensor->feature.data(), sizeof(interval_ms));
        sensor->interval_ms = interval_ms;
        sensor->is_on = sensor->feature[4] == kAllEventsState && sensor->feature[5] == kFullPowerState;
      }
    } else {
      reply.type = UHID_GET_REPORT_REPLY;
      uhid_get_report_reply_req& answer = reply.u.get_report_reply;
      answer.id = question.u.get_report.id;
      answer.err = sensor == nullptr ? EIO : 0;
      if (sensor != nullptr) {
        answer.size = static_cast<std::uint16_t>(1 + sensor->feature.size());
        answer.data[0] = static_cast<std::uint8_t>(report);
        std::memcpy(answer.data + 1, sensor->feature.data(), sensor->feature.size());
      }
    }
    put(fd_, reply);
  }
}

bool UhidImu::send(std::size_t sensor, DeviceStamp time, const std::array<double, 3>& axes) noexcept {
  if (fd_ < 0) return false;
  uhid_event event;  // 4 KB, of which the kernel reads the front
  event.type = UHID_INPUT2;
  event.u.input2.size = kReportBytes;
  std::uint8_t* const data = event.u.input2.data;
  data[0] = kSensorReport[sensor];
  constexpr double kMost = std::numeric_limits<std::int32_t>::max();
  for (std::size_t i = 0; i < 3; ++i) {
    const auto count = static_cast<std::int32_t>(std::clamp(std::round(axes[i] * 1e6), -kMost, kMost));
    std::memcpy(data + 1 + 4 * i, &count, sizeof(count));
  }
  std::memcpy(data + 13, &time.ns, sizeof(time.ns));
  const std::size_t bytes = offsetof(uhid_event, u) + offsetof(uhid_input2_req, data) + kReportBytes;
  return ::write(fd_, &event, bytes) == static_cast<ssize_t>(bytes);
}

}  // namespace epiline
