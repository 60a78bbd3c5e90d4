#pragma once
// The layouts in which programs keep calibrations. Each is recognised by its own keys and read by functions of its own,
// which throw Error; calibration.cc turns that into a value. docs/calibrate.md lists what each program writes.
#include <array>
#include <initializer_list>
#include <string>

#include "pipeline/config/calibration.h"
#include "pipeline/config/yaml_file.h"

namespace epiline {

struct CalibrationFormat {
  const char* name;
  std::initializer_list<const char*> marks;  ///< a file with one of these keys has this layout
  CameraCalibration (*camera)(const YamlFile& file, const std::string& name);
  ImuCalibration (*imu)(const YamlFile& file);  ///< null: it holds no IMU
  bool has_several_cameras = true;
};

/// Null: that of ASL and Kalibr, which has no marks.
const CalibrationFormat* foreign_format(const YamlFile& file);

/// Those of ASL and Kalibr.
CameraCalibration kalibr_camera(const YamlFile& file, const std::string& name);
ImuCalibration kalibr_imu(const YamlFile& file);

/// `T_cam_imu`, `T_BS` or `T_imu_cam` into R_BC and p_BC.
void read_pose(const YamlFile& file, const YAML::Node& map, CameraCalibration& camera);

/// Mei's lens with radial-tangential distortion, as kUnified: xi, k1 k2 p1 p2, gamma1 gamma2 u0 v0.
void set_mei(double xi, const std::array<double, 4>& distortion, const std::array<double, 4>& intrinsics,
             CameraParameters& lens);

/// Readings are `accelerometer_M` f + bias, and `gyroscope_M` `C` w + `A` f + bias. Throws where a matrix has no
/// inverse.
ImuCorrection correction_of(const YamlFile& file, const Mat3& accelerometer_M, const Mat3& gyroscope_M, const Mat3& C,
                            const Mat3& A);

}  // namespace epiline
