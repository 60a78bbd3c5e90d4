#include "drivers/sensors/camera/v4l2_device.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <string_view>

#include "drivers/sensors/camera/v4l2_lists.h"
#include "drivers/sensors/trouble.h"

namespace epiline {

namespace {

constexpr std::uint32_t kCapture = V4L2_BUF_TYPE_VIDEO_CAPTURE;
constexpr int kMostDevices = 64;
/// Raspberry Pi 5 and before: they take the time in the interrupt of the frame's start.
constexpr std::string_view kFirstRowDrivers[] = {"rp1-cfe", "unicam"};
constexpr double kRateTolerance = 0.02;  // 29.97 Hz is what a camera means by 30

}  // namespace

void write_fourcc(std::uint32_t fourcc, char (&text)[5]) noexcept {
  for (int i = 0; i < 4; ++i) {
    const auto c = static_cast<unsigned char>(fourcc >> (8 * i) & 0x7f);
    text[i] = std::isprint(c) != 0 ? static_cast<char>(c) : ' ';
  }
  text[4] = '\0';
}

v4l2_buffer mapped_buffer(std::uint32_t type, unsigned index) noexcept {
  v4l2_buffer buffer{};
  buffer.index = index;
  buffer.type = type;
  buffer.memory = V4L2_MEMORY_MMAP;
  return buffer;
}

V4l2Controls V4l2Device::controls() const noexcept {
  V4l2Controls controls(system_);
  controls.add_file(fd_);
  for (std::size_t i = 0; i < graph_.sub_devices(); ++i) controls.add_file(graph_.sub_device(i));
  return controls;
}

void V4l2Device::close() noexcept {
  graph_.close();
  if (fd_ >= 0) system_.close(fd_);
  fd_ = -1;
  watches_ = false;
}

template <class IsWanted>
bool V4l2Device::find(IsWanted is_wanted) noexcept {
  for (int i = 0; i < kMostDevices; ++i) {
    char path[32];
    std::snprintf(path, sizeof(path), "/dev/video%d", i);
    if (open_path(path)) continue;
    if (is_wanted()) return true;
    close();
  }
  std::snprintf(path_.data(), path_.size(), "/dev/video*");
  return false;
}

DeviceTrouble V4l2Device::open(const char* wanted, const char* sensor) noexcept {
  if (wanted[0] == '/') return open_path(wanted);
  const auto is_called = [&](const std::array<char, 64>& name) { return std::strcmp(name.data(), wanted) == 0; };
  const auto is_wanted = [&] {
    return is_called(identity_.card) || is_called(identity_.bus) || is_called(identity_.node);
  };
  if (find([&] { return is_wanted() && !graph_.find_way(sensor) && graph_.has_way(); })) return {};
  if (find(is_wanted)) return {};  // no sensor to be set up leads to it, or set_graph() says what is wrong
  return unexpected("open", "a camera's path, name or bus (epiline devices lists them)", "no camera is called '%.60s'",
                    wanted);
}

DeviceTrouble V4l2Device::open_again(const char* wanted, const char* sensor, const DeviceIdentity& lost,
                                     bool& is_other) noexcept {
  is_other = false;
  const DeviceTrouble trouble = open(wanted, sensor);
  // a path made of the serial number tells more than the place it is plugged in at
  const bool is_known_by_path = std::string_view(wanted).rfind("/dev/v4l/by-id/", 0) == 0;
  if (!trouble && (is_known_by_path ? identity_.card == lost.card : identity_ == lost)) return {};
  if (find([&] { return identity_ == lost; })) return {};
  is_other = !trouble;
  if (trouble) return trouble;
  return unexpected("looking for the camera that was lost", "", "%.60s is not on %.60s", lost.card.data(),
                    lost.bus.data());
}

DeviceTrouble V4l2Device::open_path(const char* path) noexcept {
  close();
  std::snprintf(path_.data(), path_.size(), "%s", path);
  fd_ = system_.open(path, O_RDWR);
  if (fd_ < 0) return refused("open", errno);
  v4l2_capability capability{};
  const int error = call(VIDIOC_QUERYCAP, &capability);
  const bool has_own = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0;
  const std::uint32_t caps = has_own ? capability.device_caps : capability.capabilities;
  DeviceTrouble trouble;
  if (error != 0)
    trouble = unexpected("VIDIOC_QUERYCAP", "a V4L2 device", "not a V4L2 device");
  else if ((caps & V4L2_CAP_VIDEO_CAPTURE) == 0 || (caps & V4L2_CAP_STREAMING) == 0)
    trouble = unexpected("VIDIOC_QUERYCAP", "a capture node: one camera may have several /dev/video files",
                         "it does not capture single-planar images (capabilities 0x%08x)", caps);
  if (trouble) {
    close();
    return trouble;
  }
  identity_ = {};
  std::snprintf(identity_.card.data(), identity_.card.size(), "%s", reinterpret_cast<const char*>(capability.card));
  std::snprintf(identity_.bus.data(), identity_.bus.size(), "%s", reinterpret_cast<const char*>(capability.bus_info));
  if (graph_.open(system_.device_number(fd_)))
    std::snprintf(identity_.node.data(), identity_.node.size(), "%s", graph_.node_name());
  const std::string_view driver(reinterpret_cast<const char*>(capability.driver));
  is_loopback_ = driver == "v4l2 loopback";
  stamps_first_row_ =
      std::find(std::begin(kFirstRowDrivers), std::end(kFirstRowDrivers), driver) != std::end(kFirstRowDrivers);
  return {};
}

DeviceTrouble V4l2Device::control(const char* name, std::int64_t& value) noexcept {
  ControlFacts facts;
  if (const DeviceTrouble trouble = controls().find(name, facts)) return trouble;
  return controls().read(name, facts, value);
}

DeviceTrouble V4l2Device::set_graph(const char* sensor) noexcept {
  if (DeviceTrouble trouble = graph_.find_way(sensor)) return trouble;
  return graph_.has_way() ? graph_.link() : DeviceTrouble{};
}

/// The sensor and all behind it, so that the device gets this format. First as the sensor gives it; else something on
/// the way may make it of another.
bool V4l2Device::set_pads(PixelFormat format, int width, int height) noexcept {
  const BusFormat wanted{bus_code_of(format), width, height};
  if (wanted.code == 0) return false;
  for (const bool is_own : {true, false}) {
    for (unsigned i = 0; i < kMostListed; ++i) {
      const std::uint32_t code = graph_.sensor_code(i);
      if (code == 0) break;
      BusFormat given;
      if ((code == wanted.code) == is_own && !graph_.set_format({code, width, height}, given) && given == wanted)
        return true;
    }
  }
  return false;
}

DeviceTrouble V4l2Device::set_format(const V4l2Settings& settings, DeviceFormat& format) noexcept {
  v4l2_format current{};
  current.type = kCapture;
  if (const int error = call(VIDIOC_G_FMT, &current); error != 0) return refused("VIDIOC_G_FMT", error);
  v4l2_format set = current;
  DeviceTrouble too_slow;
  for (const PixelFormat wanted : settings.formats) {
    v4l2_pix_format& pix = set.fmt.pix;
    const auto asked = [&](int grey, std::uint32_t now) {
      return grey > 0 ? static_cast<std::uint32_t>(is_mosaic(wanted) ? 2 * grey : grey) : now;
    };
    const std::uint32_t width = asked(settings.width, current.fmt.pix.width),
                        height = asked(settings.height, current.fmt.pix.height);
    if (graph_.has_way() && !set_pads(wanted, static_cast<int>(width), static_cast<int>(height))) continue;
    pix.pixelformat = fourcc_of(wanted);
    pix.width = width;
    pix.height = height;
    pix.field = V4L2_FIELD_NONE;
    pix.bytesperline = 0;
    pix.sizeimage = 0;
    // some drivers take the nearest, some refuse what they have not
    const int error = call(VIDIOC_S_FMT, &set);
    if (error != 0 && error != EINVAL) return refused("VIDIOC_S_FMT", error);
    if (error != 0 || pix.pixelformat != fourcc_of(wanted) || pix.width != width || pix.height != height) continue;
    format.format = wanted;
    format.width = static_cast<int>(pix.width);
    format.height = static_cast<int>(pix.height);
    // some drivers leave it empty for formats without padding
    const auto least = static_cast<std::uint32_t>(row_bytes(wanted, format.width));
    format.stride = static_cast<int>(pix.bytesperline > least ? pix.bytesperline : least);
    // of a USB camera, large images come fast only as MJPEG
    const DeviceTrouble trouble = set_rate(settings.rate_hz, format);
    if (!trouble || trouble.error != 0) return trouble;
    if (!too_slow) too_slow = trouble;
  }
  if (too_slow) return too_slow;
  const char* const name =
      settings.formats.size() == 1 ? to_string(settings.formats[0]) : "any format that epiline reads";
  DeviceTrouble trouble =
      unexpected("camera.width, camera.height, camera.format", "", "the camera does not offer %dx%d in %s",
                 settings.width > 0 ? settings.width : static_cast<int>(current.fmt.pix.width),
                 settings.height > 0 ? settings.height : static_cast<int>(current.fmt.pix.height), name);
  list_offers(trouble.expected);
  return trouble;
}

DeviceTrouble V4l2Device::set_own_rate(double wanted_hz, double& rate_hz) noexcept {
  v4l2_streamparm parameters{};
  parameters.type = kCapture;
  if (call(VIDIOC_G_PARM, &parameters) != 0) return {};
  v4l2_fract& interval = parameters.parm.capture.timeperframe;
  const bool is_settable = (parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) != 0;
  if (is_settable && wanted_hz > 0) {
    interval.numerator = 1000;
    interval.denominator = static_cast<std::uint32_t>(std::lround(wanted_hz * 1000));
    if (const int error = call(VIDIOC_S_PARM, &parameters); error != 0) return refused("VIDIOC_S_PARM", error);
  }
  if (interval.numerator > 0)
    rate_hz = static_cast<double>(interval.denominator) / static_cast<double>(interval.numerator);
  return {};
}

DeviceTrouble V4l2Device::set_rate(double wanted_hz, DeviceFormat& format) noexcept {
  double& rate_hz = format.rate_hz;
  rate_hz = graph_.has_way() ? graph_.set_rate(wanted_hz) : 0;
  if (rate_hz <= 0)
    if (const DeviceTrouble trouble = set_own_rate(wanted_hz, rate_hz)) return trouble;
  if (wanted_hz <= 0 || std::abs(rate_hz - wanted_hz) <= kRateTolerance * wanted_hz) return {};
  if (rate_hz <= 0)
    return unexpected("camera.rate_hz", "0, which keeps the rate that the camera has",
                      "the camera's rate cannot be set");
  DeviceTrouble trouble =
      unexpected("camera.rate_hz", "", "the camera does not offer %.6g Hz at %s %dx%d, but takes %.6g", wanted_hz,
                 to_string(format.format), format.grey_width(), format.grey_height(), rate_hz);
  list_rates(fourcc_of(format.format), static_cast<unsigned>(format.width), static_cast<unsigned>(format.height),
             trouble.expected);
  return trouble.expected[0] == '\0' ? expecting(trouble, "%.6g", rate_hz) : trouble;
}

void V4l2Device::watch_control(const ControlFacts& facts) noexcept {
  v4l2_event_subscription wish{};
  wish.type = V4L2_EVENT_CTRL;
  wish.id = facts.id;
  if (call(controls().control_file(facts.file), VIDIOC_SUBSCRIBE_EVENT, &wish) == 0) watches_ = true;
}

bool V4l2Device::next_change(std::uint32_t& id, std::int64_t& value, HostStamp& at) noexcept {
  if (!watches_) return false;
  const V4l2Controls files = controls();
  for (std::size_t i = 0; i < files.control_files(); ++i) {
    v4l2_event event{};
    if (call(files.control_file(i), VIDIOC_DQEVENT, &event) != 0 || event.type != V4L2_EVENT_CTRL) continue;
    id = event.id;
    value = event.u.ctrl.type == V4L2_CTRL_TYPE_INTEGER64 ? event.u.ctrl.value64 : event.u.ctrl.value;
    at = {static_cast<std::int64_t>(event.timestamp.tv_sec) * 1'000'000'000 + event.timestamp.tv_nsec};
    return true;
  }
  return false;
}

DeviceTrouble V4l2Device::set_controls(const V4l2Settings& settings) noexcept {
  for (const CameraControl& wanted : settings.controls)
    if (const DeviceTrouble trouble = controls().write(wanted.name.c_str(), wanted.value)) return trouble;
  // afterwards, for one control can change another
  for (const CameraControl& wanted : settings.controls) {
    ControlFacts facts;
    if (const DeviceTrouble trouble = controls().find(wanted.name.c_str(), facts)) return trouble;
    if (!facts.is_readable) continue;
    std::int64_t value = 0;
    if (const DeviceTrouble trouble = controls().read(wanted.name.c_str(), facts, value)) return trouble;
    if (value != wanted.value)
      return expecting(unexpected("VIDIOC_G_EXT_CTRLS", "", "%.60s = %lld after setting it", wanted.name.c_str(),
                                  static_cast<long long>(value)),
                       "%lld; is it overridden, as by automatic exposure?", static_cast<long long>(wanted.value));
  }
  return {};
}

void V4l2Device::hold_focus() noexcept {
  ControlFacts facts;
  if (!controls().find(V4L2_CID_FOCUS_AUTO, facts)) return;
  const ControlValue off{&facts, "autofocus", 0};
  controls().write({&off, 1});  // focus() tells whether that helped
}

Focus V4l2Device::focus() const noexcept {
  ControlFacts facts;
  std::int64_t value = 0;
  if (!controls().find(V4L2_CID_FOCUS_AUTO, facts) || controls().read("autofocus", facts, value))
    return Focus::kUnknown;
  return value == 0 ? Focus::kHeld : Focus::kAutomatic;
}

DeviceTrouble V4l2Device::request_buffers(unsigned& count) noexcept {
  v4l2_requestbuffers request{};
  request.count = count;
  request.type = kCapture;
  request.memory = V4L2_MEMORY_MMAP;
  if (const int error = call(VIDIOC_REQBUFS, &request); error != 0) return refused("VIDIOC_REQBUFS", error);
  count = request.count;
  return {};
}

DeviceTrouble V4l2Device::map(unsigned index, std::uint8_t*& data, std::size_t& length, std::uint32_t& flags) noexcept {
  v4l2_buffer buffer = mapped_buffer(kCapture, index);
  if (const int error = call(VIDIOC_QUERYBUF, &buffer); error != 0) return refused("VIDIOC_QUERYBUF", error);
  // populated now, so that the first image meets no page faults
  void* memory = system_.map(fd_, buffer.length, buffer.m.offset);
  if (memory == MAP_FAILED) return refused("mmap", errno);
  data = static_cast<std::uint8_t*>(memory);
  length = buffer.length;
  flags = buffer.flags & (V4L2_BUF_FLAG_TIMESTAMP_MASK | V4L2_BUF_FLAG_TSTAMP_SRC_MASK);
  return {};
}

int V4l2Device::export_buffer(unsigned index) noexcept {
  v4l2_exportbuffer wish{};
  wish.type = kCapture;
  wish.index = index;
  wish.flags = O_RDONLY | O_CLOEXEC;
  return call(VIDIOC_EXPBUF, &wish) == 0 ? wish.fd : -1;
}

DeviceTrouble V4l2Device::queue(unsigned index) noexcept {
  v4l2_buffer buffer = mapped_buffer(kCapture, index);
  return refused("VIDIOC_QBUF", call(VIDIOC_QBUF, &buffer));
}

int V4l2Device::dequeue(v4l2_buffer& buffer) noexcept {
  buffer = mapped_buffer(kCapture, 0);
  return call(VIDIOC_DQBUF, &buffer);
}

DeviceTrouble V4l2Device::start() noexcept {
  int type = static_cast<int>(kCapture);
  return refused("VIDIOC_STREAMON", call(VIDIOC_STREAMON, &type));
}

void V4l2Device::stop() noexcept {
  int type = static_cast<int>(kCapture);
  call(VIDIOC_STREAMOFF, &type);
  unsigned none = 0;
  request_buffers(none);
}

}  // namespace epiline
