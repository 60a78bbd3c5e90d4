#pragma once
// Do camera and gyroscope agree? From the turns both saw: time offset, rotation, and whether the axes are as
// configured.
#include <cstddef>
#include <vector>

#include "drivers/program/check/finding.h"
#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline {

/// The turn of the camera between two images from the bearings of both (unit vectors, same order): takes bearings of
/// the first to the second, robustly, as if everything were far away. False: too few.
bool turn_between(const std::vector<Vec3>& before, const std::vector<Vec3>& now, Mat3& R_CC0);

struct HandWaveResult {
  double turned_s = 0;          ///< time during which images were compared
  double rate_rad_s = 0;        ///< root mean square of the camera's turns
  double agreement = 0;         ///< of both, after all is fitted: 1 is perfect, 0 is chance
  double time_offset_s = 0;     ///< t_IMU = t_image + time_offset
  double offset_sharpness = 0;  ///< loss of agreement 10 ms beside
  Mat3 R_BC = Mat3::Identity();
  double weakest_axis = 0;  ///< how much it was turned about the axis it was turned about least, against the most
};

class HandWave {
 public:
  static constexpr std::size_t kReadings = 200'000;

  void add_images(const TrackedFrame& tracked);
  /// The newest kReadings at least are kept: a wave comes at the end.
  void add_reading(const ImuSample& reading);
  /// All at the end; readings and images in time order. Seconds of work for minutes of data.
  HandWaveResult result() const;

 private:
  struct Turn {
    HostStamp from, to;
    Vec3 rate_C;  ///< mean, rad/s
  };
  std::vector<Turn> turns_;
  std::vector<ImuSample> readings_;
  TrackedFrame last_;
};

/// `R_BC`, `time_offset_s`: configured.
Findings findings_of(const HandWaveResult& result, const Mat3& R_BC, double time_offset_s);

}  // namespace epiline
