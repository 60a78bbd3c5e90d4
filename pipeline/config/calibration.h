#pragma once
// Calibration files of sensors, as ASL data sets (`sensor.yaml`), Kalibr (`camchain.yaml`, `imu.yaml`) and others
// (calibration_formats.h) write them.
#include <filesystem>
#include <optional>
#include <string>

#include "estimator/config.h"
#include "estimator/geometry/camera.h"
#include "estimator/inertial/preintegration.h"
#include "pipeline/config/devices.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

struct CameraCalibration {
  CameraParameters parameters;
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();
  double time_offset_s = 0;  ///< t_IMU = t_image + time_offset (Kalibr's timeshift_cam_imu)
};

/// Makes the readings of an IMU with wrong scales and axes those of a right one.
struct ImuCorrection {
  Mat3 accelerometer = Mat3::Identity(), gyroscope = Mat3::Identity();  ///< times a reading
  Mat3 gyroscope_by_force = Mat3::Zero();  ///< times the right force: what is subtracted from the rate
  bool is_none() const;
  void apply(ImuSample& sample) const noexcept;
};

struct ImuCalibration {
  ImuNoise noise;
  std::optional<double> saturation_gyroscope_rad_s, saturation_accelerometer_m_s2;
  ImuCorrection correction;
};

/// Keys: `T_BS` (or Kalibr's `T_cam_imu`), `resolution`, `camera_model` (pinhole, double-sphere, omni, eucm),
/// `intrinsics`, `distortion_model` (radial-tangential, equidistant, none), `distortion_coefficients`, optionally
/// `timeshift_cam_imu` and, of a rolling shutter, `line_delay_nanoseconds`; or those of another format. In files of
/// several cameras `name` (cam0, cam1) is looked up. Fails if and only if the file cannot be read, is not YAML, lacks a
/// key, names an unknown model, or holds an impossible value: number of parameters, focal length, resolution, or a
/// matrix that is not a rigid motion.
Result<CameraCalibration> read_camera_calibration(const std::filesystem::path& path, const std::string& name);

/// Tells the estimator of them: pose, focal length, time offset and shutter; noise, and saturation if it is known.
void set_calibration(const CameraCalibration& camera, EstimatorConfig& estimator);
void set_calibration(const ImuCalibration& imu, EstimatorConfig& estimator);

/// Whether the file is one of several cameras and contains this one.
bool is_chain_with(const std::filesystem::path& path, const std::string& name);

/// A rolling shutter of section [camera] wins over the calibration file's line delay.
void set_shutter(const CameraConfig& section, CameraParameters& camera);

/// Keys: `gyroscope_noise_density`, `gyroscope_random_walk`, `accelerometer_noise_density`,
/// `accelerometer_random_walk`, optionally `gyroscope_saturation` (rad/s) and `accelerometer_saturation` (m/s^2).
/// `T_BS` (or Kalibr's `T_i_b`) must be the identity if given, because the body is the IMU. In Kalibr's files the keys
/// are below `imu0`; its scales and misalignments become the correction. Or those of another format. Fails like
/// read_camera_calibration().
Result<ImuCalibration> read_imu_calibration(const std::filesystem::path& path);

/// True for the `sensor.yaml` of a sensor that was recorded before it was calibrated: `sensor_type`, and no key of a
/// calibration. Such a file counts as none.
bool holds_no_calibration(const std::filesystem::path& path);

}  // namespace epiline
