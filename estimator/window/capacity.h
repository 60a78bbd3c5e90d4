#pragma once
// Capacities of the window. Plain numbers: the kernels' sources include them.

namespace epiline {

inline constexpr int kMaxFrames = 21;     ///< keyframes (at most 20) and the newest frame
inline constexpr int kCameraMotions = 7;  ///< time offset, extrinsic rotation, extrinsic translation
inline constexpr int kLensNumbers = 2;    ///< focal length, shape
inline constexpr int kImuScales = 2;      ///< accelerometer, gyroscope
inline constexpr int kCameraCalibration = kCameraMotions + kLensNumbers;
inline constexpr int kCalibration = kCameraCalibration + kImuScales;
inline constexpr int kMaxTracks = 1024;
inline constexpr int kMaxCameras = 4;
inline constexpr int kPriorDim = 6 * kMaxFrames + 9 + kCalibration;
inline constexpr int kMarginalDim = 15 + kPriorDim;
inline constexpr int kMarginalStride = 168;  ///< kMarginalDim rounded up to whole vectors

}  // namespace epiline
