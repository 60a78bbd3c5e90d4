#pragma once
// The sliding window: frames, tracks, calibration, and the prior from marginalised states. Fixed capacity; frames are
// reordered by index, never moved.
#include <algorithm>
#include <array>
#include <cstdint>

#include "estimator/config.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/preintegration.h"
#include "estimator/inertial/wheel_way.h"
#include "estimator/window/capacity.h"
#include "estimator/window/observation.h"
#include "platform/samples/samples.h"

namespace epiline {

/// In double precision.
inline Vec3 bearing_of(const Observation& o) { return Eigen::Map<const Eigen::Vector3f>(o.f_C).cast<double>(); }
inline Mat23 chart_of(const Observation& o) {
  return Eigen::Map<const Eigen::Matrix<float, 2, 3, Eigen::RowMajor>>(o.chart).cast<double>();
}
/// `f_C`: a unit vector; `chart`: d pixel / d f there, rad to px. The other numbers stay.
void set_view(const Vec3& f_C, const Mat23& chart, Observation& o);

/// Frames that stay for their own sake behind the newest one. With three, the newest velocity still hangs on a long
/// interval now and then; more leave too few keyframes (docs/derivations/marginalisation.md).
inline constexpr int kRecentFrames = 4;

inline constexpr int kViewCells = 1024;  ///< 32 x 32 squares of 64 pixels; what is beyond shares the outermost

/// A track, and the slots of the frames that saw it. The views are stored separately (Window::view), because most loops
/// over tracks need only the slots.
struct TrackRecord {
  std::uint32_t id = 0;
  std::uint32_t mask = 0;          ///< bit s: slot s has a view
  std::uint32_t second = 0;        ///< bit s: slot s has a view of a second camera, too
  std::uint8_t camera = 0;         ///< whose track it is
  std::uint8_t second_camera = 0;  ///< behind it, which the second views are of; 0: none so far
  bool in_use = true;              ///< by the visual factors; see choose_tracks()
  std::uint16_t cell = 0;          ///< below kViewCells: where in the image it was seen last
  std::uint16_t place = 0;         ///< of its observations
};

/// Camera against IMU, its lens, and the scales of the IMU; the estimated part of the calibration. Tangent order:
/// (td, dphi of R_BC on the right, p_BC, focal, shape, s_a, s_g).
struct Calibration {
  double time_offset = 0;  ///< t_IMU = t_image + time_offset, s
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();
  double focal = 0;  ///< 1 - configured over true focal length
  double shape = 0;  ///< 1 - configured over true radius in the image 32 degrees off the axis, focal length aside
  ImuScale scale;
  double focal_ratio() const { return 1 / (1 - focal); }
  /// True over configured radius in the image 45 degrees off the axis, focal length aside.
  double edge_ratio() const { return 1 / (1 - kAtEdge * shape); }
  /// The same of lengths there, across the circle about the axis: where the radius grows with its square, thrice as far
  /// from 1.
  double edge_magnification() const { return 1 + 3 * (edge_ratio() - 1); }
  static constexpr double kAtEdge = 1.9526;  ///< 1 - cos of that, over that of 32 degrees
};
/// Columns of the tangent.
inline constexpr int kTimeOffsetColumn = 0, kRotationColumn = 1, kTranslationColumn = 4, kFocalColumn = 7,
                     kShapeColumn = 8, kAccelerometerScaleColumn = 9, kGyroscopeScaleColumn = 10;
using CalibrationTangent = Eigen::Matrix<double, kCalibration, 1>;
using CalibrationCovariance = Eigen::Matrix<double, kCalibration, kCalibration>;
/// Of a state and time offset with the calibration.
using CrossCovariance = Eigen::Matrix<double, 16, kCalibration>;
void retract(Calibration& c, const CalibrationTangent& d);
CalibrationTangent local(const Calibration& c0, const Calibration& c);

/// What the user knows of some numbers of the calibration, from column `at` on. Standard deviations in rad, m,
/// relative.
struct CalibrationPart {
  int at, numbers;
  double sigma = 0;  ///< near the configured values; 0: not estimated
  double found = 0;  ///< how far from the configured values the truth most likely is
  // Of a rotation the maximum that is not held to.
  double elsewhere = 0;       ///< how likely the truth is there instead, 0 to 1; fades within seconds
  Vec3 other = Vec3::Zero();  ///< where, from the configured values
  /// Mean square of the truth's distance from what was solved, beyond the solve's covariance.
  Mat3 doubt = Mat3::Zero();
};
struct CalibrationPrior {
  Calibration configured;
  CalibrationPart rotation{kRotationColumn, 3}, translation{kTranslationColumn, 3}, focal{kFocalColumn, 1},
      shape{kShapeColumn, 1}, accelerometer_scale{kAccelerometerScaleColumn, 1},
      gyroscope_scale{kGyroscopeScaleColumn, 1};
  std::array<CalibrationPart*, 6> parts() {
    return {&rotation, &translation, &focal, &shape, &accelerometer_scale, &gyroscope_scale};
  }
  std::array<const CalibrationPart*, 6> parts() const {
    return {&rotation, &translation, &focal, &shape, &accelerometer_scale, &gyroscope_scale};
  }
};

/// The pose of a camera D in the first one: x_C = R_CD x_D + p_CD.
struct RigPose {
  Mat3 R_CD = Mat3::Identity();
  Vec3 p_CD = Vec3::Zero();
};

/// The cameras, which are mounted rigidly.
struct Rig {
  std::array<bool, kMaxCameras> use{true};  ///< whose views count; the first one's always do
  std::array<RigPose, kMaxCameras> poses;
  bool has_others() const { return use[1] || use[2] || use[3]; }
};

/// What a height sensor says of a frame (docs/derivations/height.md).
struct HeightReading {
  bool has = false;
  std::uint32_t series = 0;     ///< readings of one series have one offset, which walks
  double metres = 0;            ///< barometer: the height; range finder: 0
  Vec3 lever_B = Vec3::Zero();  ///< to the point whose height is measured: the barometer, or the end of the beam
  double walked_m2 = 0;         ///< variance of the offset's walk up to here, since any beginning
};

/// Tracks near the end of a frame's beam (docs/derivations/height.md#tracks-near-a-beam).
struct BeamTracks {
  int count = 0;
  std::array<std::uint32_t, 4> ids{};
  std::array<double, 4> shares{};  ///< of the height of the ground; 0: not used in this solve
  double drop_m = 0;               ///< from the camera to the beam's end
  double variance = 0;             ///< of that height minus the height of the beam's end, m^2; 0: nothing is known
};

/// Square-root information of an IMU interval, 15x15, in rows of whole vectors.
using RootInformation = Eigen::Matrix<double, 15, 16, Eigen::RowMajor>;

/// A frame of the window.
struct Slot {
  std::uint64_t id = 0;         ///< never reused
  HostStamp image_stamp, time;  ///< by the camera; the same instant on the IMU's clock, as integrated
  double time_offset_used = 0;  ///< `time` - `image_stamp`
  NavState x;
  Preintegration imu;                                   ///< from the frame before
  RootInformation L_inverse = RootInformation::Zero();  ///< of `imu`
  Vec3 omega = Vec3::Zero();                            ///< last angular rate, bias not removed, rad/s
  bool at_rest = false;                                 ///< zero-motion factor attached
  bool shaken = false;                                  ///< at rest: loosely
  bool attitude_held = false;                           ///< at rest: with the attitude of the rest frame
  bool stays = true;                                    ///< false: no keyframe; leaves as it is no longer recent
  bool silent = false;                                  ///< no readings since the frame before: only images tie it
  bool refused = false;                                 ///< silent, since the images contradict its readings
  bool forces_doubted = false;                          ///< its readings show the turn alone, by the images
  double unknown_step = 0;                              ///< rad/s, of the gyroscope's bias, by the images
  bool for_time = false;                                ///< kept only so that no IMU interval grows too long
  WheelWay wheel;                                       ///< from the frame before, as `imu`
  std::array<HeightReading, kHeightKinds> heights;      ///< factor attached to those that it has
  BeamTracks beam;
  double path_m = -1;           ///< horizontal way up to here, since any beginning; negative: not measured yet
  std::uint64_t rest_link = 0;  ///< id of the frame whose position it shares; 0: none in the window
  bool only_images() const { return silent || forces_doubted; }  ///< tell how it moved
};

/// Gaussian prior 1/2 d'Hd - b'd with d = x [-] x0, over poses 0..frames-1, (v, b) of frame 0 and the calibration.
struct Prior {
  int frames = 0;  ///< 0: no prior
  alignas(64) double H[kPriorDim][kMarginalStride];
  double b[kPriorDim];
  std::array<NavState, kMaxFrames> x0;
  Calibration c0;
  int dim() const { return frames > 0 ? 6 * frames + 9 + kCalibration : 0; }
  int calibration_row() const { return 6 * frames + 9; }
};

/// True for a unit bearing and a Jacobian that a camera can have. Others would corrupt the solve.
bool is_possible(const TrackedFeature& feature) noexcept;
bool is_possible(const SecondView& view) noexcept;

class Window {
 public:
  /// `capacity`: frames at which a flight that has settled lets its oldest go; up to then, kMaxFrames.
  explicit Window(int capacity) : capacity_(capacity) { clear(); }

  void clear();
  int size() const { return size_; }
  int capacity() const { return capacity_; }
  /// Frames, from the oldest on, that stay until they are the oldest.
  int lasting() const {
    int n = std::max(2, size_ - 1 - kRecentFrames);
    while (n < size_ - 1 && at(n).stays) ++n;
    return std::min(n, size_ - 1);
  }
  /// Frames in time order, 0 the oldest.
  Slot& at(int k) { return slots_[order_[k]]; }
  const Slot& at(int k) const { return slots_[order_[k]]; }
  Slot& newest() { return at(size_ - 1); }
  const Slot& newest() const { return at(size_ - 1); }
  int index_of(std::uint64_t slot_id) const;  ///< -1: not in the window

  /// The stamps of the newest frame, and of all that follow, are found late by so much more.
  void slip(double by_s);
  /// Appends an empty frame to fewer than kMaxFrames.
  Slot& append();
  /// Removes frame k and its bearings. The caller joins the IMU intervals.
  void remove(int k);
  struct Observed {
    int without_room = 0;  ///< new tracks beyond kMaxTracks
    int impossible = 0;    ///< features left out: see is_possible()
  };
  /// Adds the newest frame's bearings.
  Observed observe(const TrackedFrame& frame);
  /// Removes the tracks of which `leaves` is true.
  template <class Leaves>
  void forget(const Leaves& leaves) {
    for (int i = 0; i < tracks_; ++i)
      if (TrackRecord& t = track(i); leaves(t)) t.mask = t.second = 0;
    prune();
  }
  /// Removes tracks without further information: not seen by the newest frame, and fewer than two views.
  void prune();

  int track_count() const { return tracks_; }
  TrackRecord& track(int i) { return records_[i]; }
  const TrackRecord& track(int i) const { return records_[i]; }
  /// The bit of frame k in a track's mask.
  std::uint32_t bit(int k) const { return 1u << order_[k]; }
  bool seen(const TrackRecord& t, int k) const { return t.mask & bit(k); }
  const Observation& view(const TrackRecord& t, int k) const { return views_[t.place][order_[k]]; }
  /// By its second camera.
  bool seen_by_second(const TrackRecord& t, int k) const { return t.second & bit(k); }
  const Observation& second_view(const TrackRecord& t, int k) const { return second_views_[t.place][order_[k]]; }
  Observation& view(const TrackRecord& t, int k) { return views_[t.place][order_[k]]; }
  /// Prefetches a track's observations.
  void fetch(const TrackRecord& t) const;
  int views(const TrackRecord& t) const { return __builtin_popcount(t.mask); }
  /// Track index by id; -1: unknown.
  int find(std::uint32_t id) const;

  Rig rig;
  Calibration calibration;
  CalibrationPrior calibration_prior;
  WheelModel wheel;
  std::array<double, kHeightKinds> height_sigmas_m{};  ///< of the white noise
  Prior prior;

 private:
  static constexpr std::uint32_t kBuckets = 4096;  // four times the tracks: short probes
  void observe(const TrackedFeature& feature, std::uint8_t camera, Observed& seen);
  bool observe_second(const SecondView& view, std::uint8_t camera);
  void rebuild_index();
  void insert_index(std::uint32_t id, int i);

  int capacity_, size_ = 0, tracks_ = 0;
  std::uint64_t next_id_ = 1;
  std::array<std::uint8_t, kMaxFrames> order_{};
  std::array<Slot, kMaxFrames> slots_;
  std::array<TrackRecord, kMaxTracks> records_;
  std::array<std::array<Observation, kMaxFrames>, kMaxTracks> views_, second_views_;
  std::array<std::int16_t, kBuckets> index_;
};

}  // namespace epiline
