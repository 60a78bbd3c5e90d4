// Any bytes as a calibration file, whosever layout it has: read, with a camera that can be one and an IMU whose
// readings stay numbers, or refused with an error. Never a crash.
#include <cmath>
#include <cstdint>
#include <filesystem>

#include "pipeline/config/calibration.h"
#include "tests/fuzz/scratch_folder.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ScratchFolder folder("calibration_fuzz");
  const std::filesystem::path path = folder.write("calibration.yaml", text_of(data, size));
  const auto camera = epiline::read_camera_calibration(path, "cam0");
  if (camera) {
    expect(camera->parameters.width > 0 && camera->parameters.intrinsics[0] > 0);
    expect(std::abs(camera->R_BC.determinant() - 1) < 1e-9);
  }
  const auto imu = epiline::read_imu_calibration(path);
  if (imu) {
    expect(imu->noise.gyroscope_density > 0);
    expect(imu->correction.gyroscope.allFinite() && imu->correction.accelerometer.allFinite());
  }
  epiline::is_chain_with(path, "cam1");
  return 0;
}
