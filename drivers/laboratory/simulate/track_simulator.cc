#include "drivers/laboratory/simulate/track_simulator.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace epiline {
namespace {

enum TrackStream : std::uint64_t { kTrackFlightStream, kTrackImuStream, kTrackStream };

struct CameraPose {
  Vec3 p_WC;
  Mat3 R_WC;
};

/// The camera while it takes an image: each row at its own time.
class Exposure {
 public:
  Exposure(const Flight& flight, const TrackSimulation& s, double t_s)
      : flight_(flight), e_(true_extrinsics(s)), row_s_(s.readout_s / (s.height - 1)), t_s_(t_s), middle_(at(t_s)) {}

  bool is_rolling() const { return row_s_ != 0; }
  const CameraPose& middle() const { return middle_; }
  /// `y_px`: below the image's centre.
  CameraPose at_row(double y_px) const { return is_rolling() ? at(t_s_ + row_s_ * y_px) : middle_; }

 private:
  CameraPose at(double t_s) const {
    const Motion m = flight_.at(t_s);
    return {m.p_WB + m.R_WB * e_.p_BC, m.R_WB * e_.R_BC};
  }

  const Flight& flight_;
  Extrinsics e_;
  double row_s_, t_s_;
  CameraPose middle_;
};

struct Track {
  std::uint32_t id = 0, age = 0;
  Vec3 point_W;
  Vec2 pixel;        ///< where it is, without any error
  Vec2 offset;       ///< error that stays with the track
  Vec2 offset_step;  ///< drifters: what the error grows by, px per image
  Vec2 observed_last;
};

/// The tracks of one camera on one flight.
class TrackSource {
 public:
  TrackSource(const TrackSimulation& simulation, const Room& room, const Random& random)
      : s_(simulation), room_(room), random_(random), centre_(0.5 * (s_.width - 1), 0.5 * (s_.height - 1)) {}

  void next_image(const Exposure& camera, double image_interval_s, std::vector<TrackObservation>& out) {
    follow(camera);
    while (static_cast<int>(tracks_.size()) < s_.tracks) tracks_.push_back(begin_track(camera));
    for (Track& track : tracks_) out.push_back(observe(track, image_interval_s));
  }
  double mean_life() const { return lost_ ? static_cast<double>(lost_life_) / static_cast<double>(lost_) : 0; }

 private:
  static constexpr double kNearest_m = 0.1;     ///< nothing closer is seen
  static constexpr double kMargin_px = 4;       ///< tracks end this far from the border,
  static constexpr double kBirthMargin_px = 6;  ///< and begin this far from it

  Vec2 half_size(double margin_px) const { return Vec2(0.5 * s_.width - margin_px, 0.5 * s_.height - margin_px); }

  bool project(const CameraPose& camera, const Vec3& point_W, Vec2& from_centre) const {
    const Vec3 p_C = camera.R_WC.transpose() * (point_W - camera.p_WC);
    if (p_C.z() < kNearest_m) return false;
    from_centre = s_.focal_px * p_C.head<2>() / p_C.z();
    return true;
  }

  bool project(const Exposure& camera, const Vec3& point_W, Vec2& pixel) const {
    constexpr int kRounds = 6;  // each row's time follows from the row: a factor of about a hundredth a round
    Vec2 from_centre = Vec2::Zero();
    if (!project(camera.middle(), point_W, from_centre)) return false;
    for (int n = 0; n < kRounds && camera.is_rolling(); ++n)
      if (!project(camera.at_row(from_centre.y()), point_W, from_centre)) return false;
    pixel = centre_ + from_centre;
    return (from_centre.array().abs() < half_size(kMargin_px).array()).all();
  }

  /// Moves the tracks on to the next image; some are lost there.
  void follow(const Exposure& camera) {
    const auto lost = [&](Track& track) {
      const Vec2 before = track.pixel;
      bool seen = project(camera, track.point_W, track.pixel) && !random_.chance(s_.loss_share);
      if (seen && (track.pixel - before).norm() > s_.fast_px) seen = !random_.chance(s_.fast_loss_share);
      if (!seen) {
        ++lost_;
        lost_life_ += track.age + 1;
        return true;
      }
      ++track.age;
      track.offset += random_.normal2(s_.noise.drift_px) + track.offset_step;
      return false;
    };
    std::erase_if(tracks_, lost);
  }

  /// Depth (along the optical axis) of the room's wall in the direction `ray_W`, whose depth is 1.
  double wall_depth(const Vec3& p_WC, const Vec3& ray_W) const {
    double depth = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
      const double wall = ray_W[k] > 0 ? room_.high[k] : room_.low[k];
      depth = std::min(depth, (wall - p_WC[k]) / ray_W[k]);
    }
    return depth;
  }

  Track begin_track(const Exposure& exposure) {
    constexpr double kNearestBirth_m = 0.3;
    const Vec2 half = half_size(kBirthMargin_px);
    Vec2 from_centre;
    for (int k = 0; k < 2; ++k) from_centre[k] = random_.uniform(-half[k], half[k]);
    const CameraPose camera = exposure.at_row(from_centre.y());
    const Vec3 ray_W = camera.R_WC * (from_centre / s_.focal_px).homogeneous();
    const double depth = wall_depth(camera.p_WC, ray_W) * random_.uniform(room_.nearest_share, 1);
    Track track;
    track.id = next_id_++;
    track.point_W = camera.p_WC + std::max(depth, kNearestBirth_m) * ray_W;
    track.pixel = track.observed_last = centre_ + from_centre;
    track.offset.setZero();
    track.offset_step.setZero();
    if (random_.chance(s_.noise.outlier_share)) {
      const double angle = random_.uniform(0, 2 * std::numbers::pi);
      track.offset_step = random_.uniform(0.3, 1.5) * Vec2(std::cos(angle), std::sin(angle));
    }
    return track;
  }

  TrackObservation observe(Track& track, double image_interval_s) {
    constexpr double kGross_px = 20;
    Vec2 pixel = track.pixel + track.offset + random_.normal2(s_.noise.pixel_sigma);
    if (random_.chance(0.5 * s_.noise.outlier_share))
      for (int k = 0; k < 2; ++k) pixel[k] += random_.uniform(-kGross_px, kGross_px);
    TrackObservation observation{track.id, track.age, pixel, Vec2::Zero()};
    if (track.age > 0) observation.velocity_px_s = (pixel - track.observed_last) / image_interval_s;
    track.observed_last = pixel;
    return observation;
  }

  const TrackSimulation& s_;
  const Room& room_;
  Random random_;
  Vec2 centre_;
  std::vector<Track> tracks_;
  std::uint32_t next_id_ = 0;
  std::uint64_t lost_ = 0, lost_life_ = 0;
};

}  // namespace

Mat3 simulated_camera_axes(FlightKind flight) {
  Mat3 R_BC;
  if (looks_down(flight)) {
    R_BC << 0, -1, 0, -1, 0, 0, 0, 0, -1;  // the camera's x, y, z are the body's -y, -x, -z
  } else {
    R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;  // the camera's x, y, z are the body's -y, -z, x
  }
  return R_BC;
}

Extrinsics true_extrinsics(const TrackSimulation& simulation) {
  Extrinsics e;
  e.R_BC = simulated_camera_axes(simulation.flight);
  e.p_BC = simulation.p_BC;
  e.focal_px = simulation.focal_px;
  e.time_offset_s = simulation.time_offset_s;
  e.readout_s = simulation.readout_s;
  return e;
}

SimulatedFlight simulate_tracks(const TrackSimulation& simulation) {
  Random random(simulation.seed, kTrackFlightStream);
  return simulate_tracks(simulation, make_flight(simulation.flight, random, simulation.height_m));
}

SimulatedFlight simulate_tracks(const TrackSimulation& simulation, Flight made) {
  SimulatedFlight result;
  result.flight = std::move(made);
  const Flight& flight = result.flight;
  ImuSimulator imu(simulation.imu, Random(simulation.seed, kTrackImuStream));
  TrackSource tracks(simulation, flight.room(), Random(simulation.seed, kTrackStream));

  result.width = simulation.width;
  result.height = simulation.height;
  result.focal_px = simulation.focal_px;
  result.extrinsics = true_extrinsics(simulation);
  const double interval_s = 1 / simulation.imu.rate_hz;
  const double image_interval_s = interval_s * simulation.imu_samples_per_image;
  const int samples = static_cast<int>(flight.duration_s() / interval_s) + 1;
  for (int k = 0; k < samples; ++k) {
    const double t = k * interval_s;
    const Motion m = flight.at(t);
    const HostStamp stamp = kFlightBegin + Span::from_seconds(t);
    if (k % simulation.imu_samples_per_image == 0) {
      SimulatedImage image;
      image.stamp_true = stamp;
      image.stamp = stamp - Span::from_seconds(simulation.time_offset_s);
      image.truth = {m.p_WB, m.v_WB, m.R_WB, imu.accelerometer_bias(), imu.gyroscope_bias()};
      image.begin = result.observations.size();
      tracks.next_image({flight, simulation, t}, image_interval_s, result.observations);
      image.end = result.observations.size();
      result.images.push_back(image);
    }
    result.imu.push_back(imu.read(stamp, m));
  }
  result.mean_track_life = tracks.mean_life();
  return result;
}

void SimulatedFlight::fill(std::size_t image, TrackedFrame& frame) const {
  const SimulatedImage& source = images[image];
  frame.stamp = source.stamp;
  frame.sequence = image;
  frame.features.clear();
  const Vec2 centre(0.5 * (width - 1), 0.5 * (height - 1));
  for (std::size_t i = source.begin; i < source.end; ++i) {
    const TrackObservation& o = observations[i];
    TrackedFeature f;
    f.id = o.id;
    f.age = o.age;
    for (std::size_t k = 0; k < 2; ++k) {
      f.pixel[k] = static_cast<float>(o.pixel[static_cast<int>(k)]);
      f.velocity_px_s[k] = static_cast<float>(o.velocity_px_s[static_cast<int>(k)]);
    }
    const Vec2 z = (o.pixel - centre) / focal_px;
    const double norm = z.homogeneous().norm();
    const Vec3 bearing = z.homogeneous() / norm;
    f.bearing = {bearing.x(), bearing.y(), bearing.z()};
    // pixel = centre + focal (X/Z, Y/Z) at (X, Y, Z) = bearing, where 1/Z = norm
    const double s = focal_px * norm;
    f.pixel_jacobian = {s, 0, -s * z.x(), 0, s, -s * z.y()};
    f.row_s = static_cast<float>(extrinsics.readout_s * (o.pixel.y() - centre.y()) / (height - 1));
    frame.features.push_back(f);
  }
}

}  // namespace epiline
