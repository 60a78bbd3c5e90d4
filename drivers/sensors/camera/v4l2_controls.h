#pragma once
// The controls of a camera: found by name, read and set. No heap, no exceptions.
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/error/device_trouble.h"
#include "platform/linux/system_calls.h"
#include "platform/memory/fixed_vector.h"

namespace epiline {

/// A control that holds a number, as the device describes it.
struct ControlFacts {
  std::uint32_t id = 0, type = 0;  ///< id 0: none
  std::size_t file = 0;            ///< which of the camera's files has it: see V4l2Controls
  bool is_readable = false;
  std::int64_t least = 0, most = 0;
};

struct ControlValue {
  const ControlFacts* facts = nullptr;
  const char* name = "";
  std::int64_t value = 0;
};

/// As v4l2-ctl writes names: "Exposure Time, Absolute" becomes exposure_time_absolute; as much as fits.
void write_control_name(const char* shown, std::span<char> name) noexcept;

/// ioctl(): 0 or errno; begins again when a signal came in between. EAGAIN is the caller's: of VIDIOC_DQBUF it means
/// that there is no image.
int call_device(SystemCalls& system, int fd, unsigned long request, void* argument) noexcept;

/// The files that have a camera's controls: the device's, then those of the sub-devices on the way from the sensor.
/// A transfer to a USB camera may take seconds. Owns none of the files.
class V4l2Controls {
 public:
  explicit V4l2Controls(SystemCalls& system) noexcept : system_(&system) {}

  void add_file(int fd) noexcept { files_.push_back(fd); }
  std::size_t control_files() const noexcept { return files_.size(); }
  int control_file(std::size_t i) const noexcept { return files_[i]; }
  int call(int fd, unsigned long request, void* argument) const noexcept {
    return call_device(*system_, fd, request, argument);
  }

  DeviceTrouble find(const char* name, ControlFacts& facts) const noexcept;
  /// By the kernel's number (V4L2_CID_...). False: the camera has no such control.
  bool find(std::uint32_t id, ControlFacts& facts) const noexcept;
  DeviceTrouble read(const char* name, const ControlFacts& facts, std::int64_t& value) const noexcept;
  /// Sets some (kTogether at most) in one call.
  static constexpr std::size_t kTogether = 4;
  DeviceTrouble write(std::span<const ControlValue> values) const noexcept;
  /// Sets one, found by its name.
  DeviceTrouble write(const char* name, std::int64_t value) const noexcept;
  /// Sets some, in one call where one file has them all, then reads them back: each value becomes what the device made
  /// of it.
  DeviceTrouble change(std::span<ControlValue> values) const noexcept;

 private:
  template <class IsWanted>
  bool find_first(IsWanted is_wanted, ControlFacts& facts) const noexcept;

  SystemCalls* system_;
  FixedVector<int, 9> files_;  ///< the device, and the steps that a media graph has at most
};

}  // namespace epiline
