#pragma once
// What the tests of the camera against kernel drivers share. They run in the machine of tests/hardware/vm.
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "drivers/sensors/camera/v4l2_camera.h"
#include "tests/hardware/support.h"

namespace epiline {

inline constexpr Span kSecond = Span::from_milliseconds(1'000);
/// Waits end with what is waited for; an emulated machine under load stands still for seconds.
inline constexpr Span kPatience{120 * kSecond.ns};

/// Settings under which a machine that stands still is not taken for a device that is lost, nor its images for old.
inline V4l2Settings patient_settings() {
  V4l2Settings settings;
  settings.silence_most = kPatience;
  settings.stamp_age_most = kPatience;
  return settings;
}

inline int open_files() {
  int count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
  return count;
}

/// The address ranges of this process that are memory of a video device.
struct Mapping {
  std::uintptr_t begin = 0, end = 0;
};
inline std::vector<Mapping> device_mappings() {
  std::vector<Mapping> mappings;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    if (line.find("/dev/video") == std::string::npos) continue;
    const auto dash = line.find('-');
    mappings.push_back({std::stoul(line.substr(0, dash), nullptr, 16), std::stoul(line.substr(dash + 1), nullptr, 16)});
  }
  return mappings;
}
inline bool is_device_memory(const std::uint8_t* data) {
  for (const Mapping& m : device_mappings())
    if (reinterpret_cast<std::uintptr_t>(data) >= m.begin && reinterpret_cast<std::uintptr_t>(data) < m.end)
      return true;
  return false;
}

/// Sets controls as another program would, while the camera is in use.
inline void set_controls(const std::string& device, std::vector<CameraControl> controls) {
  V4l2Device other;
  ASSERT_FALSE(other.open(device.c_str(), ""));
  V4l2Settings settings;
  settings.controls = std::move(controls);
  const DeviceTrouble trouble = other.set_controls(settings);
  ASSERT_FALSE(trouble) << trouble.step << " " << trouble.found;
}

/// Reads until there is an image; false after `at_most`. `failures` counts what read() said on the way.
inline bool read_within(CameraSource& camera, Frame& frame, Span at_most, int* failures = nullptr) {
  const std::int64_t until_ns = monotonic_ns() + at_most.ns;
  while (monotonic_ns() < until_ns) {
    const ReadOutcome outcome = camera.read(frame, Span::from_milliseconds(100));
    if (outcome == ReadOutcome::kSample) return true;
    if (outcome == ReadOutcome::kFailed && failures != nullptr) ++*failures;
  }
  return false;
}

/// Reads until something is so; false after kPatience. Images are given back.
inline bool read_until(V4l2Camera& camera, const std::function<bool()>& is_so) {
  const std::int64_t until_ns = monotonic_ns() + kPatience.ns;
  while (!is_so()) {
    if (monotonic_ns() > until_ns) return false;
    Frame frame;
    if (camera.read(frame, Span::from_milliseconds(100)) == ReadOutcome::kSample) camera.give_back(frame);
  }
  return true;
}

/// Reads images, looks at each, gives it back.
inline void watch(V4l2Camera& camera, int images, const std::function<void(const Frame&)>& look) {
  for (int i = 0; i < images; ++i) {
    Frame frame;
    ASSERT_TRUE(read_within(camera, frame, kPatience)) << "image " << i;
    look(frame);
    camera.give_back(frame);
  }
}

}  // namespace epiline
