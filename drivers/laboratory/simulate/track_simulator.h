#pragma once
// A flight as the estimator sees it, without any image: IMU samples and feature tracks whose identity is perfect and
// whose noise is known.
#include <cstdint>
#include <vector>

#include "drivers/laboratory/simulate/flights.h"
#include "drivers/laboratory/simulate/imu_model.h"
#include "estimator/estimator.h"
#include "platform/samples/samples.h"

namespace epiline {

/// The IMU's time at the first sample and image of every simulated flight.
inline constexpr HostStamp kFlightBegin{100'000'000'000};

struct TrackNoise {
  double pixel_sigma = 1;  ///< white, each image coordinate, px
  /// Share of the tracks that drift away at 0.3 to 1.5 px per image. Half that share of all observations is off by up
  /// to 20 px besides.
  double outlier_share = 0;
  double drift_px = 0;  ///< random walk of every track, px per root of an image: what KLT does
};

struct TrackSimulation {
  FlightKind flight = FlightKind::kAgile;
  std::uint64_t seed = 1;
  ImuModel imu;
  TrackNoise noise;
  // the camera: a pinhole, principal point in the middle
  int width = 752, height = 480;
  double focal_px = 458;
  int imu_samples_per_image = 10;
  int tracks = 150;           ///< kept in every image
  double loss_share = 0.015;  ///< tracks lost at random, per image
  double fast_px = 45,
         fast_loss_share = 0.3;  ///< a track that moves further than this in one image is lost with this probability
  double time_offset_s = 0;      ///< t_IMU - t_image: image stamps are too early by this much
  double height_m = kUsualHeight_m;  ///< of a survey
  double readout_s = 0;              ///< rolling shutter: exposure of the last row minus that of the first
  Vec3 p_BC{0.06, 0.02, -0.01};      ///< m; the camera looks along the body's x axis, or down
};

struct TrackObservation {
  std::uint32_t id = 0;
  std::uint32_t age = 0;  ///< images since the track began
  Vec2 pixel = Vec2::Zero();
  Vec2 velocity_px_s = Vec2::Zero();  ///< from the previous image; zero where the age is 0
};

struct BodyState {
  Vec3 p_WB, v_WB;
  Mat3 R_WB;
  Vec3 b_a, b_g;
};

struct SimulatedImage {
  HostStamp stamp;       ///< as the camera says
  HostStamp stamp_true;  ///< in the IMU's time
  BodyState truth;
  std::size_t begin = 0, end = 0;  ///< its part of SimulatedFlight::observations
};

class SimulatedFlight {
 public:
  std::vector<ImuSample> imu;
  std::vector<SimulatedImage> images;
  std::vector<TrackObservation> observations;
  Flight flight;               ///< where the body truly was, at any time
  Extrinsics extrinsics;       ///< the true ones, time offset included
  double mean_track_life = 0;  ///< images, over the tracks that ended

  /// The truth at an instant of the IMU's time.
  Motion truth_at(HostStamp stamp) const { return flight.at((stamp - kFlightBegin).seconds()); }
  /// One image in the words of the estimator.
  void fill(std::size_t image, TrackedFrame& frame) const;

  int width = 0, height = 0;
  double focal_px = 0;
};

/// Axes of a camera that looks along the body's x axis, or down with the body's x axis up in the image.
Mat3 simulated_camera_axes(FlightKind flight);
/// Camera and clock as they are simulated.
Extrinsics true_extrinsics(const TrackSimulation& simulation);

SimulatedFlight simulate_tracks(const TrackSimulation& simulation);
/// Of another flight, in its room. `simulation.flight` says where the camera looks.
SimulatedFlight simulate_tracks(const TrackSimulation& simulation, Flight flight);

}  // namespace epiline
