#pragma once
// How a camera is turned on the IMU and how late its stamps are, from the turns of both alone: the start of the fit.
#include <vector>

#include "estimator/geometry/types.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

/// A camera's orientation in a frame that stands still.
struct CameraOrientation {
  HostStamp stamp;
  Mat3 R_TC = Mat3::Identity();
};

struct TurnAlignment {
  Mat3 R_BC = Mat3::Identity();
  double time_offset_s = 0;  ///< t_IMU = t_image + time_offset
  Vec3 gyroscope_bias = Vec3::Zero();
  double misfit_rad_s = 0;  ///< rms of what the camera's rates differ from the gyroscope's
};

/// The rotation and bias that bring the camera's mean rates between neighbouring images closest to the gyroscope's
/// (Kabsch 1976), at the time offset within half a second where they come closest. Fails if and only if there are too
/// few pairs of images, they do not turn about two axes, or the two do not agree at any offset.
Result<TurnAlignment> align_turns(const std::vector<CameraOrientation>& turns, const std::vector<ImuSample>& imu);

}  // namespace epiline
