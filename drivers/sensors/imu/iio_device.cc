#include "drivers/sensors/imu/iio_device.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <climits>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "drivers/sensors/trouble.h"

namespace epiline {

namespace {

using Text = IioAttributes::Text;

constexpr std::array kTypes{"anglvel", "accel"};
constexpr std::array kAxes{'x', 'y', 'z'};
constexpr double kRateTolerance = 0.02;
constexpr double kReadingsPerWake_hz = 500;  // faster sensors wake us for several readings at once
constexpr const char* kNoDriver = "an IMU whose kernel driver is loaded";
constexpr const char* kAccess = "write access: root, or the group and udev rules that give it";

template <std::size_t N, class... Values>
const char* print(std::array<char, N>& into, const char* format, Values... values) noexcept {
  std::snprintf(into.data(), N, format, values...);
  return into.data();
}

/// `error` 0: no trouble.
DeviceTrouble refused_file(const char* step, int error) noexcept {
  const bool is_access = error == EACCES || error == EPERM || error == EROFS;
  return error != 0 ? device_refusal(step, error, is_access ? kAccess : "") : DeviceTrouble{};
}

/// Which axis an entry like in_accel_x_en switches on: those of the gyroscope first; -1: none.
int axis_of(const char* entry) noexcept {
  std::array<char, 64> name;
  for (std::size_t i = 0; i < kIioAxes; ++i)
    if (std::strcmp(entry, print(name, "in_%s_%c_en", kTypes[i / 3], kAxes[i % 3])) == 0) return static_cast<int>(i);
  return -1;
}

bool begins(const char* text, const char* with) noexcept { return std::strncmp(text, with, std::strlen(with)) == 0; }

/// Calls `use(entry, attributes)` for each device (`kind` "iio:device") or trigger until that returns false. Returns
/// errno, 0 if they could be listed.
template <class Use>
int for_each_of(const IioRoots& roots, const char* kind, Use use) noexcept {
  return for_each_entry(roots.attributes, [&](const char* entry) {
    IioAttributes attributes;
    std::array<char, 256> folder;
    if (!begins(entry, kind)) return true;
    attributes.set_folder(print(folder, "%s/%s", roots.attributes, entry));
    return use(entry, attributes);
  });
}

/// Names of the devices or triggers there are, with commas.
Text names_of(const IioRoots& roots, const char* kind) noexcept {
  Text names;
  std::size_t length = 0;
  for_each_of(roots, kind, [&](const char* /*entry*/, const IioAttributes& attributes) {
    Text name;
    if (attributes.read("name", name) != 0) return true;
    const int added = std::snprintf(names.data.data() + length, names.data.size() - length, "%s%s",
                                    length > 0 ? ", " : "", name.c_str());
    length = std::min(length + static_cast<std::size_t>(std::max(added, 0)), names.data.size() - 1);
    return true;
  });
  return names;
}

/// Without trailing zeros: some drivers take integers only.
const char* print_rate(std::array<char, 32>& into, double rate_hz) noexcept {
  print(into, "%.6f", rate_hz);
  std::size_t length = std::strlen(into.data());
  while (into[length - 1] == '0') into[--length] = '\0';
  if (into[length - 1] == '.') into[--length] = '\0';
  return into.data();
}

bool is_rate(double found_hz, double wanted_hz) noexcept {
  return std::abs(found_hz - wanted_hz) <= kRateTolerance * wanted_hz;
}

}  // namespace

bool parse_mount_matrix(const char* text, std::array<double, 9>& matrix) noexcept {
  const char* at = text;
  const char* const end = text + std::strlen(text);
  for (std::size_t i = 0; i < 9; ++i) {
    while (*at == ' ') ++at;
    const auto [stop, failed] = std::from_chars(at, end, matrix[i]);
    if (failed != std::errc{} || !std::isfinite(matrix[i]) || std::abs(matrix[i]) > 2) return false;
    at = stop;
    if (i < 8 && *at++ != (i % 3 == 2 ? ';' : ',')) return false;
  }
  if (*at != '\0') return false;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b <= a; ++b) {
      double product = 0;
      for (std::size_t k = 0; k < 3; ++k) product += matrix[3 * a + k] * matrix[3 * b + k];
      if (std::abs(product - (a == b ? 1 : 0)) > 0.02) return false;  // written with few digits
    }
  return true;
}

// ---- which device ----

DeviceTrouble IioDevice::find(const IioRoots& roots, const char* wanted) noexcept {
  int found = 0;
  std::array<char, 96> all{};
  const auto note = [&](const char* entry) {
    const std::size_t length = std::strlen(all.data());
    std::snprintf(all.data() + length, all.size() - length, "%s%s", found > 0 ? ", " : "", entry);
    if (found++ == 0) print(folder_name_.data, "%s", entry);
  };
  if (wanted[0] == '/') {
    std::array<char, PATH_MAX> path;
    if (::realpath(wanted, path.data()) == nullptr) return refused_file("open", errno);
    const char* const last = std::strrchr(path.data(), '/') + 1;
    if (!begins(last, "iio:device")) return unexpected("open", "an IIO device", "%s is not an IIO device", wanted);
    note(last);
  } else {
    const int error = for_each_of(roots, "iio:device", [&](const char* entry, const IioAttributes& attributes) {
      Text name, label;
      attributes.read("name", name);
      attributes.read("label", label);
      if (std::strcmp(entry, wanted) == 0 || std::strcmp(name.c_str(), wanted) == 0 ||
          std::strcmp(label.c_str(), wanted) == 0)
        note(entry);
      return true;
    });
    if (error == ENOENT) return unexpected("open", kNoDriver, "there are no IIO devices");
    if (error != 0) return refused_file("open", error);
  }
  if (found == 0) {
    const Text names = names_of(roots, "iio:device");
    const DeviceTrouble trouble = unexpected("open", kNoDriver, "no IIO device is called '%s'", wanted);
    return names.empty() ? trouble : expecting(trouble, "one of %.88s", names.c_str());
  }
  if (found > 1) return unexpected("open", all.data(), "%d devices are called '%s'", found, wanted);
  std::array<char, 256> folder;
  attributes_.set_folder(print(folder, "%s/%s", roots.attributes, folder_name_.c_str()));
  Text name;
  if (const int error = attributes_.read("name", name); error != 0) return refused_file("name", error);
  print(name_.data, "%.63s", name.c_str());
  return {};
}

ShortText<512> IioDevice::hub() const noexcept {
  ShortText<512> hub;
  std::array<char, PATH_MAX> path;
  if (::realpath(attributes_.folder(), path.data()) == nullptr) return hub;
  // .../hub/HID-SENSOR-200076.1.auto/iio:device0
  if (char* const sensor = std::strstr(path.data(), "/HID-SENSOR-")) {
    *sensor = '\0';
    print(hub.data, "%.511s", path.data());
  }
  return hub;
}

/// One reader at a time: the kernel sees to that.
DeviceTrouble IioDevice::take(const IioRoots& roots) noexcept {
  std::array<char, 256> path;
  fd_ = ::open(print(path, "%s/%s", roots.files, folder_name_.c_str()), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd_ >= 0) return {};
  if (errno == EBUSY) return unexpected("open", "no other reader: the kernel allows one", "another program reads it");
  const DeviceTrouble trouble = refused_file("open", errno);
  return trouble.error == EACCES ? expecting(trouble, "read access to %.70s", path.data()) : trouble;
}

// ---- setting up ----

DeviceTrouble IioDevice::open(const IioRoots& roots, const IioRequest& request) noexcept {
  close();
  sensors_ = {};
  DeviceTrouble trouble = find(roots, request.device);
  if (!trouble) trouble = take(roots);
  // left on by a program that ended badly
  if (!trouble) trouble = refused_file("buffer/enable", attributes_.write_for_good("buffer/enable", "0"));
  if (!trouble) trouble = choose_channels(request);
  if (!trouble) trouble = write("current_timestamp_clock", "monotonic");
  if (!trouble) trouble = choose_trigger(roots, request.trigger);
  if (!trouble) trouble = set_rate(request.rate_hz);
  if (!trouble) trouble = set_buffer();
  if (!trouble) trouble = read_layout();
  for (std::size_t i = 0; i < kTypes.size() && !trouble; ++i)
    if (i == 0 ? request.gyroscope : request.accelerometer) trouble = read_sensor(kTypes[i], sensors_[i]);
  if (!trouble) {
    trouble = write("buffer/enable", "1");
    if (trouble.error == EINVAL)
      trouble = expecting(trouble, "imu.trigger, one of %.70s", names_of(roots, "trigger").c_str());
  }
  if (trouble) close();
  return trouble;
}

void IioDevice::close() noexcept {
  if (fd_ < 0) return;
  attributes_.restore();
  trigger_.restore();
  ::close(fd_);
  fd_ = -1;
}

/// Those that are asked for and the time are on, all others off.
DeviceTrouble IioDevice::choose_channels(const IioRequest& request) noexcept {
  const std::array wanted{request.gyroscope, request.accelerometer};
  std::array<char, 256> folder;
  std::array<char, 64> name;
  DeviceTrouble trouble;
  // off first: some devices allow certain combinations only
  const int error = for_each_entry(print(folder, "%s/scan_elements", attributes_.folder()), [&](const char* entry) {
    const std::size_t length = std::strlen(entry);
    if (length < 4 || std::strcmp(entry + length - 3, "_en") != 0) return true;
    const int axis = axis_of(entry);
    const bool is_wanted =
        axis >= 0 ? wanted[static_cast<std::size_t>(axis / 3)] : std::strcmp(entry, "in_timestamp_en") == 0;
    Text value;
    print(folder, "scan_elements/%s", entry);
    if (is_wanted || attributes_.read(folder.data(), value) != 0 || std::strcmp(value.c_str(), "0") == 0) return true;
    trouble = refused_file("disabling channels", attributes_.write(folder.data(), "0"));
    return !trouble;
  });
  if (error != 0) return unexpected("scan_elements", "a device with a buffer", "%s", std::strerror(error));
  for (std::size_t i = 0; i < kTypes.size() && !trouble; ++i)
    for (std::size_t axis = 0; axis < kAxes.size() && wanted[i] && !trouble; ++axis) {
      const int refusal = attributes_.write(print(name, "scan_elements/in_%s_%c_en", kTypes[i], kAxes[axis]), "1");
      if (refusal == ENOENT)
        return unexpected("channels",
                          i == 0 ? "a gyroscope in imu.device"
                                 : "an accelerometer, in imu.device or in another one (imu.device_accel)",
                          "%s has no %s", name_.c_str(), i == 0 ? "gyroscope" : "accelerometer");
      trouble = refused_file("enabling channels", refusal);
    }
  return trouble ? trouble : write("scan_elements/in_timestamp_en", "1");
}

DeviceTrouble IioDevice::choose_trigger(const IioRoots& roots, const char* wanted) noexcept {
  Text current;
  trigger_.set_folder("");
  if (attributes_.read("trigger/current_trigger", current) != 0)  // the device needs none
    return wanted[0] == '\0' ? DeviceTrouble{}
                             : unexpected("trigger", "imu.trigger not to be set", "%s has no trigger", name_.c_str());
  std::array<char, 96> own;
  print(own, "%s-dev%s", name_.c_str(), folder_name_.c_str() + std::strlen("iio:device"));
  const char* const name = wanted[0] != '\0' ? wanted : current.empty() ? own.data() : current.c_str();
  bool is_there = false;
  for_each_of(roots, "trigger", [&](const char* /*entry*/, const IioAttributes& attributes) {
    Text its_name;
    if (attributes.read("name", its_name) != 0 || std::strcmp(its_name.c_str(), name) != 0) return true;
    trigger_.set_folder(attributes.folder());
    is_there = true;
    return false;
  });
  if (!is_there && wanted[0] != '\0') {
    return expecting(unexpected("trigger", "", "no trigger is called '%s'", wanted), "one of %.88s",
                     names_of(roots, "trigger").c_str());
  }
  if (!is_there || std::strcmp(current.c_str(), name) == 0) return {};
  return write("trigger/current_trigger", name);
}

/// The rate is an attribute of the device, of its sensors, or of its trigger.
DeviceTrouble IioDevice::set_rate(double wanted_hz) noexcept {
  rate_hz_ = 0;
  std::array<char, 32> wanted;
  print_rate(wanted, wanted_hz);
  for (const char* name :
       {"sampling_frequency", "in_anglvel_sampling_frequency", "in_accel_sampling_frequency", "trigger"}) {
    const bool is_trigger = std::strcmp(name, "trigger") == 0;
    if (is_trigger && (rate_hz_ > 0 || trigger_.folder()[0] == '\0')) break;
    IioAttributes& attributes = is_trigger ? trigger_ : attributes_;
    if (is_trigger) name = "sampling_frequency";
    double found_hz = 0;
    if (attributes.read(name, found_hz) == ENOENT) continue;
    const int error = is_rate(found_hz, wanted_hz) ? 0 : attributes.write(name, wanted.data());
    if (error == EACCES || error == EPERM) return refused_file(name, error);
    if (error == 0 && attributes.read(name, found_hz) == 0 && is_rate(found_hz, wanted_hz)) {
      rate_hz_ = found_hz;
      continue;
    }
    Text available;
    std::array<char, 64> list;
    attributes.read(print(list, "%s_available", name), available);
    return expecting(unexpected("rate", "", "%s is %g Hz after setting %s", name, found_hz, wanted.data()),
                     "a rate that it has in imu.rate_hz%s%.70s", available.empty() ? "" : ": ", available.c_str());
  }
  return {};
}

DeviceTrouble IioDevice::set_buffer() noexcept {
  const double rate_hz = rate_hz_ > 0 ? rate_hz_ : kReadingsPerWake_hz;
  const int length = std::clamp(static_cast<int>(rate_hz / 2), 64, 4096);  // half a second
  double least = 1;
  attributes_.read("buffer/hwfifo_watermark_min", least);
  const int watermark = std::clamp(static_cast<int>(std::max(least, rate_hz / kReadingsPerWake_hz)), 1, length / 2);
  std::array<char, 16> number;
  if (const DeviceTrouble trouble = write("buffer/length", print(number, "%d", length))) return trouble;
  const DeviceTrouble trouble = write("buffer/watermark", print(number, "%d", watermark));
  return trouble.error == ENOENT ? DeviceTrouble{} : trouble;
}

DeviceTrouble IioDevice::write(const char* name, const char* value) noexcept {
  return refused_file(name, attributes_.write(name, value));
}

/// As it is now: a device may have switched on more than it was told.
DeviceTrouble IioDevice::read_layout() noexcept {
  layout_.clear();
  DeviceTrouble trouble;
  std::array<char, 256> folder;
  for_each_entry(print(folder, "%s/scan_elements", attributes_.folder()), [&](const char* entry) {
    const std::size_t length = std::strlen(entry);
    std::array<char, 64> name;
    Text text;
    if (length < 4 || length > 40 || std::strcmp(entry + length - 3, "_en") != 0) return true;
    const int stem = static_cast<int>(length) - 3;
    if (attributes_.read(print(name, "scan_elements/%s", entry), text) != 0 || std::strcmp(text.c_str(), "1") != 0)
      return true;
    const int axis = axis_of(entry);
    const IioChannel channel = axis >= 0                                    ? static_cast<IioChannel>(axis)
                               : std::strcmp(entry, "in_timestamp_en") == 0 ? IioChannel::kTimestamp
                                                                            : IioChannel::kOther;
    double index = -1;
    IioType type;
    const int no_index = attributes_.read(print(name, "scan_elements/%.*s_index", stem, entry), index);
    const int no_type = attributes_.read(print(name, "scan_elements/%.*s_type", stem, entry), text);
    if (no_index != 0 || no_type != 0 || index < 0 || index > 1'000 || !parse_iio_type(text.c_str(), type) ||
        !layout_.add(channel, static_cast<int>(index), type))
      trouble = unexpected("layout of a scan", "a type like le:s16/16>>0", "%s: %.40s", entry, text.c_str());
    return !trouble;
  });
  if (!trouble && !layout_.finish())
    trouble = unexpected("layout of a scan", "a 64-bit timestamp in each scan", "a scan has no timestamp");
  return trouble;
}

DeviceTrouble IioDevice::read_sensor(const char* type, Sensor& sensor) noexcept {
  sensor = {};
  std::array<char, 64> name;
  for (std::size_t axis = 0; axis < kAxes.size(); ++axis) {
    // of the axis, or of all three
    const auto read = [&](const char* what, double& number) {
      return attributes_.read(print(name, "in_%s_%c_%s", type, kAxes[axis], what), number) == 0 ||
             attributes_.read(print(name, "in_%s_%s", type, what), number) == 0;
    };
    if (!read("scale", sensor.scale[axis])) return unexpected("scale", "a number", "%s has no number", name.data());
    if (!read("offset", sensor.offset[axis])) sensor.offset[axis] = 0;
  }
  Text matrix;
  if (attributes_.read(print(name, "in_%s_mount_matrix", type), matrix) != 0 &&
      attributes_.read(print(name, "%s", "in_mount_matrix"), matrix) != 0 &&
      attributes_.read(print(name, "%s", "mount_matrix"), matrix) != 0)
    return {};
  return parse_mount_matrix(matrix.c_str(), sensor.mount)
             ? DeviceTrouble{}
             : unexpected("mount matrix", "a rotation: 1, 0, 0; 0, 1, 0; 0, 0, 1", "%.50s: %.40s", name.data(),
                          matrix.c_str());
}

// ---- readings ----

int IioDevice::read(std::span<IioReading> readings, std::size_t& count) noexcept {
  count = 0;
  const std::size_t room = std::min({readings.size(), kMostReadings, bytes_.size() / layout_.bytes()});
  const ssize_t got = ::read(fd_, bytes_.data(), room * layout_.bytes());
  if (got < 0) return errno == EINTR ? EAGAIN : errno;
  const auto bytes = static_cast<std::size_t>(got);
  if (bytes == 0 || bytes % layout_.bytes() != 0) return EPROTO;
  for (std::size_t at = 0; at < bytes; at += layout_.bytes()) {
    IioScan scan;
    layout_.read(std::span<const std::uint8_t>(bytes_).subspan(at, layout_.bytes()), scan);
    IioReading& reading = readings[count++];
    reading.stamp_ns = scan.stamp_ns;
    for (std::size_t s = 0; s < 2; ++s) {
      const Sensor& sensor = sensors_[s];
      std::array<double, 3>& value = s == 0 ? reading.angular_velocity_rad_s : reading.specific_force_m_s2;
      std::array<double, 3> chip{};
      for (std::size_t i = 0; i < 3; ++i) chip[i] = (scan.axes[3 * s + i] + sensor.offset[i]) * sensor.scale[i];
      for (std::size_t i = 0; i < 3; ++i)
        value[i] =
            sensor.mount[3 * i] * chip[0] + sensor.mount[3 * i + 1] * chip[1] + sensor.mount[3 * i + 2] * chip[2];
    }
  }
  return 0;
}

}  // namespace epiline
