#pragma once
// The estimator's parts, and the two lives it leads: starting (starting.cc) and running (running.cc), with what a reset
// hands from one to the other (carrying.cc). Rules: docs/derivations/health.md.
#include <array>
#include <memory>
#include <optional>

#include "estimator/estimator.h"
#include "estimator/factors/visual.h"
#include "estimator/inertial/bias_walk.h"
#include "estimator/inertial/imu_history.h"
#include "estimator/inertial/noise_bounds.h"
#include "estimator/inertial/scalar_history.h"
#include "estimator/inertial/stationary.h"
#include "estimator/initialise/starter.h"
#include "estimator/monitor/contradiction.h"
#include "estimator/monitor/health.h"
#include "estimator/monitor/interval_watch.h"
#include "estimator/monitor/rest_detector.h"
#include "estimator/monitor/suspicion.h"
#include "estimator/monitor/turn_watch.h"
#include "estimator/monitor/wheel_watch.h"
#include "estimator/predict/covariance.h"
#include "estimator/solver/marginalise.h"
#include "estimator/solver/solver.h"
#include "estimator/window/window.h"

namespace epiline {

/// px: more noise is a fault, not a property of the tracks; less is not believed of any tracker.
inline constexpr double kLeastPixelSigma = 0.3, kMostPixelSigma = 2;
inline constexpr double kUsualDrift = 0.15;  ///< px per root of an image: of tracks that were not measured yet
/// Without a reading to be trusted: too far to go on from (docs/derivations/health.md).
inline constexpr double kLongestUnknown_s = 0.25;
/// Heights further apart in time are not interpolated.
inline constexpr Span kHeightInterval = Span::from_milliseconds(500);

/// A state with its covariance at an instant of the IMU. The only thing that survives a reset.
struct KnownState {
  bool known = false;    ///< false before the first start
  bool trusted = false;  ///< the estimator was healthy there: attitude and velocity are worth going on from
  HostStamp time;
  NavState x;
  Vec3 omega = Vec3::Zero();                    ///< rad/s, bias included
  StateCovariance P = StateCovariance::Zero();  ///< in the window's world
  bool silent = false;                          ///< carried on without images: the covariance is widened
  CrossCovariance with_calibration = CrossCovariance::Zero();
};

/// Covariance of a state with the calibration, at the end of an interval that begins at that state, whose attitude was
/// `R_WB`.
CrossCovariance carried_on(const CrossCovariance& from, const Mat3& R_WB, const Preintegration& interval) noexcept;

/// What the sensors of height have shown of offsets and ground, in this world.
struct HeightMemory {
  std::array<std::uint32_t, kHeightKinds> series{};  ///< the newest of each sensor
  std::array<std::uint32_t, 256> beam_tracks{};      ///< that have served frames that have left
  std::size_t beam_tracks_served = 0;
  double ground_step_m = 0, ground_step_at_m = 0;  ///< the last jump of the range finder, and the way up to there
};

/// What the wheels read of the newest frame.
enum class WheelMotion : std::uint8_t { kUnknown, kStand, kTurn };

struct Estimator::Impl {
  explicit Impl(const EstimatorConfig& c);

  // estimator.cc: what is let in
  StepResult process(const TrackedFrame& frame, Supervisor& supervisor);
  bool add_imu(const ImuSample& sample);
  StepResult refuse();
  void say(HealthReason reason);
  HostStamp imu_time(HostStamp image) const;
  FoundPose found_pose() const;
  void watch_numbers(const TrackedFrame& frame);
  double exposed_within_s() const;
  const TrackedFrame& at_stamp(const TrackedFrame& frame);
  void use_noise(const ImuNoise& n);
  void hold_noise();

  // running.cc: one solved frame, and the images between two of them
  StepResult step(const TrackedFrame& frame, Supervisor& supervisor, const Supervisor::Effort& effort);
  bool cut(const TrackedFrame& frame);
  KnownState predicted_newest() const;
  bool doubt_contradicted_forces();
  void take_from_solver(const NavState& predicted, double dt_s);
  void doubt_origin(const NavState& predicted, double dt_s);
  void attach(const TrackedFrame& frame);
  bool has_left(bool shakes) const;
  void attach_rest(const TrackedFrame& frame);
  void integrate_again(int k, const Vec3& b_a, const Vec3& b_g);
  void reintegrate_moved_biases();
  void reintegrate_revised();
  bool mount_is_elsewhere() const;
  SolverSummary solve(Supervisor& supervisor, const Supervisor::Effort& effort);
  SolverSettings solver_settings(const Supervisor::Effort& effort) const;
  void count(const SolverSummary& s);
  void learn_from_residuals(const SolverSummary& solved, double dt_s);
  void adapt_pixel_sigma(double seen_px, double dt_s);
  void judge(const TrackedFrame& frame, const SolverSummary& s, FrameEvidence e, double dt_s);
  void slide(Supervisor& supervisor);
  void learn_walks();
  bool is_of_newest_frame(const ImuStatistics& read) const;
  bool rest_is_contradicted(double dt_s);
  StateCovariance doubt_of_leaving() const;
  StepResult begin_anew_at_rest(const TrackedFrame& frame);
  bool second_newest_stays() const;
  void marginalise(Supervisor& supervisor);
  void thin(int k);
  bool drop(int k);
  StepResult predict(const TrackedFrame& frame);
  StepResult predict_for_time(const TrackedFrame& frame);
  void publish(HostStamp image, const KnownState& s);
  VisualSettings visual_settings() const;
  double window_age_s(HostStamp now) const { return (now - started_at).seconds(); }

  // wheels.cc
  bool add_wheel(const WheelSample& sample);
  void learn_wheel_noise();
  void attach_wheel();
  void find_wheel_slips();
  void watch_wheels();
  WheelMotion wheel_motion() const;

  // heights.cc: the sensors of height
  bool add_height(const HeightSample& sample);
  void attach_heights();
  void measure_path();
  std::uint32_t series_of(HeightKind kind, int frame) const;
  void note_ground_step(int frame);
  void attach_beam_tracks();
  void remember_beam_tracks();

  // starting.cc
  StepResult initialise(const TrackedFrame& frame, Supervisor& supervisor);
  void make_room();
  bool knows_oldest() const;
  void add_known_velocity(StarterSettings& s) const;
  void set_known_prior();
  std::optional<StartRefusal> try_start(const TrackedFrame& frame, Supervisor& supervisor);
  std::optional<StartRefusal> start_at_rest(const TrackedFrame& frame);
  std::optional<StartRefusal> start_moving(const TrackedFrame& frame, Supervisor& supervisor);
  std::optional<StartRefusal> posterior_refusal(const SolverSummary& s) const;
  void take_back_start(const Calibration& before);
  void start(const TrackedFrame& frame, const InitialState& state, StartKind kind);
  void began(StartKind kind);
  void remember_origin();
  bool estimates_focal_length() const;
  SolverSettings solver_settings(int steps) const;
  Calibration configured_calibration() const;
  CalibrationTangent calibration_sigmas() const;
  StarterSettings starter_settings() const;
  Vec3 known_gyroscope_bias() const;

  // carrying.cc
  KnownState carried_to(HostStamp time) const {
    return carried_on_to(time < carried.time ? carried_from : carried, time);
  }
  KnownState carried_on_to(const KnownState& from, HostStamp time) const;
  bool forces_are_unknown(const KnownState& from, HostStamp until) const;
  bool is_silent(HostStamp from, HostStamp to) const;
  bool images_suffice(const TrackedFrame& frame) const;
  void coast(const Slot& from, double T, Preintegration& interval) const;
  bool integrate(const Slot& from, Slot& to) const;
  void carry_while_silent();
  bool may_go_on(const KnownState& s) const;
  bool go_on(const TrackedFrame& frame);
  int seen_again(const TrackedFrame& frame) const;
  bool go_on_after_silence(const TrackedFrame& frame);
  StepResult start_anew(const TrackedFrame& frame, Supervisor& supervisor);
  void go_on_from_carried(const TrackedFrame& frame);
  void reset();
  void forget();

  EstimatorConfig config;
  NoiseBounds noise_bounds;
  BiasWalk accelerometer_walk{4}, gyroscope_walk{100};
  ImuNoise noise;               ///< configured, within the bounds
  ImuHistory::Density density;  ///< the same with its factors
  Window window;
  ImuHistory history;
  ScalarHistory wheel{Span::from_milliseconds(250)};
  std::array<ScalarHistory, kHeightKinds> heights{ScalarHistory{kHeightInterval}, ScalarHistory{kHeightInterval}};
  std::unique_ptr<VisualFactorModel> visual;
  Solver solver;
  Marginaliser marginaliser;
  RestDetector rest;
  StationaryDetector stationary;
  Starter starter;
  HealthMonitor monitor;
  TurnWatch turns;
  UnitsWatch units;
  WheelWatch wheel_watch;
  double wheel_variance = 0;  ///< of the speeds' noise, as they scatter
  Odometry odometry;
  EstimatorStats stats;

  TrackedFrame turned;  ///< the last frame, as if all of it had been exposed at its stamp
  bool any_frame = false;
  HostStamp last_offered;  ///< stamp of the last image
  HostStamp last_frame;    ///< stamp of the last image let in
  bool imu_gap_seen = false;
  KnownState carried;       ///< the newest frame solved, or carried on from there by the IMU
  KnownState carried_from;  ///< where that last began: readings may be ahead of the images
  CalibrationCovariance calibration_covariance = CalibrationCovariance::Zero();  ///< by the last solve; 0: none yet
  HostStamp numbers_judged_at;
  Severity numbers_wrong = Severity::kNone;  ///< by the watches' present verdict
  /// The same without turns that are unrelated: what the camera saw while it was handled says nothing of a rest.
  Severity wrong_at_rest = Severity::kNone;
  ContradictionWatch contradictions;  ///< a reset does not forget it
  IntervalWatch intervals;            ///< nor this
  Severity contradiction_judged = Severity::kNone;
  /// What the last start did not know of its own place and heading (nothing in the first one), and how wrong it was
  /// where the calibration turned out to be far off.
  WorldUncertainty world;

  // all of this is forgotten in a reset
  bool started = false;
  HostStamp started_at;
  Mat3 began_R_BC = Mat3::Identity();  ///< then
  double pixel_sigma, drift_sigma;
  bool rejected_last = false;
  bool may_slide = false;         ///< the newest frame was solved, and its window has not slid since
  bool start_lacks_time = false;  ///< the last start was refused since its images say too little
  KnownState before_start;        ///< what was known before of the oldest frame of a window without states
  double rethinking_s = 0;        ///< how long the window will still move to a calibration just found
  bool depth_known = false;       ///< by the images: when IMU and images last agreed
  double after_silence_s = 0;     ///< how long speed and scale will still be in doubt after a silence of the IMU
  double after_refusal_s = 0;     ///< and after readings that the images contradict
  HostStamp rest_reference;       ///< what that test compares with
  bool rest_frame_held = false;   ///< it had the attitude of the rest
  Mat3 stood;                     ///< the last attitude R_WB of which images and attitude said that nothing moved
  HostStamp stood_at, images_still_since;
  double rest_contradicted_s = 0;
  std::uint64_t rest_frame = 0;  ///< the frame that later ones at rest are linked to
  HostStamp last_marginalised;
  HeightMemory height_memory;
};

}  // namespace epiline
