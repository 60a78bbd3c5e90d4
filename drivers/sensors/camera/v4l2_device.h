#pragma once
// One open V4L2 device: what can be asked of it and set. No heap, no exceptions: it is used to reopen a lost camera in
// the middle of a flight.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/sensors/camera/media_graph.h"
#include "drivers/sensors/camera/v4l2_controls.h"
#include "drivers/sensors/camera/v4l2_settings.h"
#include "platform/error/device_trouble.h"
#include "platform/linux/system_calls.h"

struct v4l2_buffer;

namespace epiline {

/// The image as the device was set to give it.
struct DeviceFormat {
  PixelFormat format = PixelFormat::kGrey;
  int width = 0, height = 0, stride = 0;
  double rate_hz = 0;  ///< 0: the device does not say
  int grey_width() const noexcept { return is_mosaic(format) ? width / 2 : width; }
  int grey_height() const noexcept { return is_mosaic(format) ? height / 2 : height; }
};

/// Which camera it is, as far as its driver tells.
struct DeviceIdentity {
  std::array<char, 64> card{}, bus{};  ///< its name; where it is plugged in
  std::array<char, 64> node{};         ///< its name in a media graph, whose nodes share card and bus; empty: none
  bool operator==(const DeviceIdentity&) const = default;
};

enum class Focus : std::uint8_t {
  kUnknown,    ///< the device has no autofocus, or does not tell
  kHeld,       ///< it has one, which is off
  kAutomatic,  ///< it is on
};

/// Buffer `index` of a queue whose buffers the driver maps, as calls take it.
v4l2_buffer mapped_buffer(std::uint32_t type, unsigned index) noexcept;
/// A format's code as text.
void write_fourcc(std::uint32_t fourcc, char (&text)[5]) noexcept;

class V4l2Device {
 public:
  explicit V4l2Device(SystemCalls& system = SystemCalls::of_this_computer()) noexcept
      : system_(system), graph_(system) {}
  V4l2Device(const V4l2Device&) = delete;
  V4l2Device& operator=(const V4l2Device&) = delete;
  ~V4l2Device() { close(); }

  /// Opens a capture device that streams. `wanted`, `sensor`: V4l2Settings::device, ::sensor. Receivers of one kind
  /// give their nodes the same names: of several with the name, the first that the sensor leads to is taken.
  DeviceTrouble open(const char* wanted, const char* sensor) noexcept;
  /// Opens the camera that was lost, and no other: `wanted`, `sensor` as above, it was that one. It may have another
  /// number now: plugged in while images of before are lent, what was /dev/video0 comes back as another file.
  /// `is_other`: another camera is where it was.
  DeviceTrouble open_again(const char* wanted, const char* sensor, const DeviceIdentity& lost, bool& is_other) noexcept;
  void close() noexcept;
  bool is_open() const noexcept { return fd_ >= 0; }
  int fd() const noexcept { return fd_; }
  const char* path() const noexcept { return path_.data(); }
  const DeviceIdentity& identity() const noexcept { return identity_; }
  /// v4l2loopback: its buffers are written while we read them.
  bool is_loopback() const noexcept { return is_loopback_; }
  /// A receiver of CSI known to stamp when the first row begins to arrive; it declares the end of the frame.
  bool stamps_first_row() const noexcept { return stamps_first_row_; }

  /// ioctl() on the device: 0 or errno; begins again when a signal came in between.
  int call(unsigned long request, void* argument) const noexcept { return call(fd_, request, argument); }
  int call(int fd, unsigned long request, void* argument) const noexcept {
    return call_device(system_, fd, request, argument);
  }

  /// In a media graph: finds the way from the sensor and enables its links. Without one nothing.
  DeviceTrouble set_graph(const char* sensor) noexcept;
  /// Of the media graph, after set_graph(); empty: the device needs none.
  const char* sensor_name() const noexcept { return graph_.sensor_name(); }
  /// Sets the first of the formats that is to be had, size and rate.
  DeviceTrouble set_format(const V4l2Settings& settings, DeviceFormat& format) noexcept;
  /// Formats that we read with their sizes and rates, then the names of those that we do not; as much as fits.
  void list_offers(std::span<char> text) noexcept;
  /// Sets all, then reads all back.
  DeviceTrouble set_controls(const V4l2Settings& settings) noexcept;
  /// Switches autofocus off, where the device has it: a lens that refocuses is another lens than the calibrated one.
  void hold_focus() noexcept;
  /// As it is now.
  Focus focus() const noexcept;
  /// Of its own file and of the sub-devices on the way from the sensor. Valid as long as the device stays open.
  V4l2Controls controls() const noexcept;
  DeviceTrouble control(const char* name, std::int64_t& value) noexcept;
  /// From now on next_change() tells when another program changes the control. A device may not offer that.
  void watch_control(const ControlFacts& facts) noexcept;
  /// The oldest change not yet told: of which control, to what, when. False: there is none.
  bool next_change(std::uint32_t& id, std::int64_t& value, HostStamp& at) noexcept;

  /// `count` becomes the number of buffers the driver gives.
  DeviceTrouble request_buffers(unsigned& count) noexcept;
  /// Maps buffer `index`; `flags` are those that tell about stamps.
  DeviceTrouble map(unsigned index, std::uint8_t*& data, std::size_t& length, std::uint32_t& flags) noexcept;
  /// A mapped buffer as a file of its own, to be closed by the caller; -1: the driver does not offer that.
  int export_buffer(unsigned index) noexcept;
  DeviceTrouble queue(unsigned index) noexcept;
  /// 0; EAGAIN: none is ready; else the device is lost.
  int dequeue(v4l2_buffer& buffer) noexcept;
  DeviceTrouble start() noexcept;
  void stop() noexcept;  ///< also lets go of the buffers; mappings stay

 private:
  DeviceTrouble open_path(const char* path) noexcept;
  template <class IsWanted>
  bool find(IsWanted is_wanted) noexcept;
  bool set_pads(PixelFormat format, int width, int height) noexcept;
  DeviceTrouble set_rate(double wanted_hz, DeviceFormat& format) noexcept;
  DeviceTrouble set_own_rate(double wanted_hz, double& rate_hz) noexcept;
  void list_sizes(std::uint32_t fourcc, std::span<char> text) noexcept;
  void list_rates(std::uint32_t fourcc, unsigned width, unsigned height, std::span<char> text) noexcept;

  SystemCalls& system_;
  MediaGraph graph_;
  int fd_ = -1;
  std::array<char, 64> path_{};
  DeviceIdentity identity_;
  bool is_loopback_ = false, stamps_first_row_ = false, watches_ = false;
};

}  // namespace epiline
