#pragma once
// A flight that needs no data: a camera and an IMU sway through a box whose walls have a random texture. Images and
// samples are the same on every computer, but for rounding.
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "drivers/flights/motion/fitted_motion.h"
#include "drivers/flights/motion/random.h"
#include "pipeline/config/calibration.h"
#include "pipeline/text/trajectory.h"
#include "platform/samples/samples.h"

namespace epiline {

class MadeUpFlight {
 public:
  static constexpr int kImage_hz = 20, kImu_hz = 200;  ///< as EuRoC's

  explicit MadeUpFlight(double duration_s);

  const CameraCalibration& camera() const { return camera_; }
  std::size_t images() const { return images_; }
  HostStamp stamp_of_image(std::size_t k) const { return stamp_at(image_s(k)); }
  TimedPose pose_at_image(std::size_t k) const;
  /// With noise, as of a camera.
  void draw_image(std::size_t k, std::uint8_t* pixels) const;
  /// The IMU's samples, from 0.5 s before the first image to 0.5 s after the last one.
  std::vector<ImuSample> imu_samples() const;

 private:
  static double image_s(std::size_t k) { return 0.5 + static_cast<double>(k) / kImage_hz; }
  HostStamp stamp_at(double t_s) const { return motion_.begin() + Span::from_seconds(t_s); }

  CameraCalibration camera_;
  std::size_t images_;
  FittedMotion motion_;
  std::vector<Eigen::Vector2f> rays_;  ///< of each pixel, x / z and y / z in C
  std::vector<std::uint8_t> texture_;
};

}  // namespace epiline
