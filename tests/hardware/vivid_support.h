#pragma once
// The kernel's test driver vivid as a camera.
#include <cstdint>
#include <filesystem>
#include <vector>

#include "tests/hardware/camera_support.h"

namespace epiline {

inline constexpr const char* kDevice = "/dev/video0";

inline V4l2Settings small_settings() {
  V4l2Settings settings = patient_settings();
  settings.device = "vivid";
  settings.width = 320;
  settings.height = 180;
  settings.rate_hz = 30;
  settings.formats = {PixelFormat::kGrey};
  return settings;
}

class Vivid : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists("/sys/bus/platform/drivers/vivid/vivid.0"))
      GTEST_SKIP() << "the driver vivid is not loaded; expected ./run hardware";
    set_controls(kDevice, {{"timestamp_source", 0},
                           {"percentage_of_dropped_buffers", 0},
                           {"wrap_sequence_number", 0},
                           {"wrap_timestamp", 0},
                           {"test_pattern", 20},    // a ramp of grey ...
                           {"osd_text_mode", 2}});  // ... without text: all images are alike
  }
};

inline std::vector<std::uint8_t> pixels_of(const Frame& frame) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < frame.height; ++y) {
    const std::uint8_t* row = frame.data + static_cast<std::ptrdiff_t>(y) * frame.stride;
    pixels.insert(pixels.end(), row, row + frame.width);
  }
  return pixels;
}

}  // namespace epiline
