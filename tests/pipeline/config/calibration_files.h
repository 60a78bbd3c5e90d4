#pragma once
// Calibration files that a test writes, and what is read from them.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "pipeline/config/calibration.h"

namespace epiline::test {

inline std::filesystem::path calibration_file(const std::string& name, const std::string& text) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / ("epiline_" + name);
  std::ofstream(path) << text;
  return path;
}

inline CameraCalibration camera_of(const std::string& text, const std::string& name = "cam0") {
  const auto camera = read_camera_calibration(calibration_file("camera.yaml", text), name);
  EXPECT_TRUE(camera) << camera.error().text();
  return camera ? *camera : CameraCalibration{};
}

inline ImuCalibration imu_of(const std::string& text) {
  const auto imu = read_imu_calibration(calibration_file("imu.yaml", text));
  EXPECT_TRUE(imu) << imu.error().text();
  return imu ? *imu : ImuCalibration{};
}

/// Without the path of the file; "read" if there is none.
template <class T>
std::string error_without_path(const Result<T>& result, const std::filesystem::path& path) {
  if (result) return "read";
  EXPECT_EQ(result.error().text().rfind(path.string(), 0), 0u) << result.error().text();
  return result.error().text().substr(path.string().size());
}
inline std::string camera_error(const std::string& text, const std::string& name = "cam0") {
  const auto path = calibration_file("camera.yaml", text);
  return error_without_path(read_camera_calibration(path, name), path);
}
inline std::string imu_error(const std::string& text) {
  const auto path = calibration_file("imu.yaml", text);
  return error_without_path(read_imu_calibration(path), path);
}

}  // namespace epiline::test
