#pragma once
// The estimator's parts (estimator/parts) and the life they lead: images come in (estimator.cc), a window is started
// (starting.cc), runs (running.cc), is doubted (doubting.cc) and judged (judging.cc), and slides on (sliding.cc), until
// what was known at a reset begins the next one (resetting.cc). Rules: docs/derivations/health.md.
#include <memory>
#include <optional>

#include "estimator/estimator.h"
#include "estimator/factors/visual.h"
#include "estimator/initialise/starter.h"
#include "estimator/monitor/fixed_tracks.h"
#include "estimator/monitor/health.h"
#include "estimator/parts/carrying.h"
#include "estimator/parts/common.h"
#include "estimator/parts/heights.h"
#include "estimator/parts/intervals.h"
#include "estimator/parts/numbers.h"
#include "estimator/parts/resting.h"
#include "estimator/parts/wheels.h"
#include "estimator/predict/covariance.h"
#include "estimator/solver/marginalise.h"
#include "estimator/solver/solver.h"

namespace epiline {

inline constexpr double kRethinking_s = 1;  ///< until the window has moved to a calibration that is far off
/// px: more noise is a fault, not a property of the tracks; less is not believed of any tracker.
inline constexpr double kLeastPixelSigma = 0.3, kMostPixelSigma = 2;
inline constexpr int kSeenAgain = 20;        ///< tracks that tie an image to the window before it
inline constexpr double kUsualDrift = 0.15;  ///< px per root of an image: of tracks that were not measured yet

struct Estimator::Impl : Common {
  explicit Impl(const EstimatorConfig& c);

  /// The images as they came.
  struct Door {
    TrackedFrame changed;  ///< the last frame, as if all of it had been exposed at its stamp, and without fixed tracks
    FixedTracks fixed;
    FixedVector<TrackedFeature, kMaxFeatures> before;  ///< tracks of the last frame, as they came
    int copies = 0;                                    ///< of it, one after the other
    bool any_frame = false;
    double period_s = 0;     ///< the camera's: the shortest time between two recent images
    HostStamp last_offered;  ///< stamp of the last image
    HostStamp last_frame;    ///< stamp of the last image let in
  };

  /// The noise of the tracks, by their residuals.
  struct TrackNoise {
    double pixel_sigma;                ///< px
    double drift_sigma = kUsualDrift;  ///< px per root of an image
  };

  /// From a start to the next reset.
  struct Flight {
    explicit Flight(const EstimatorConfig& config) : tracks{config.pixel_sigma} {}

    HostStamp began_at;
    Mat3 began_R_BC = Mat3::Identity();
    TrackNoise tracks;
    HostStamp last_marginalised;
    bool rejected_last = false;
    double cost = 0;             ///< of the last image's solve, a track; 0: unknown
    bool may_slide = false;      ///< the newest frame was solved, and its window has not slid since
    double parallax_px = 0;      ///< of the window
    bool depth_known = false;    ///< by the images: when IMU and images last agreed
    double rethinking_s = 0;     ///< how long the window will still move to a calibration just found
    double after_silence_s = 0;  ///< how long speed and scale will still be in doubt after a silence of the IMU
    double after_refusal_s = 0;  ///< and after readings that the images contradict
  };

  /// A window without states, that may become a start.
  struct Attempt {
    bool lacks_time = false;  ///< the last one was refused since its images say too little
    int steady = 0;           ///< attempts in a row whose velocity is that of the one before
    KnownState before;        ///< what was known before of the oldest frame
  };

  // estimator.cc: what is let in
  StepResult process(const TrackedFrame& frame, Supervisor& supervisor);
  bool add_imu(const ImuSample& sample);
  bool count(ImuHistory::Push outcome);
  StepResult refuse();
  bool is_copy(const TrackedFrame& frame);
  HostStamp imu_time(HostStamp image) const;
  void hold_noise();
  double exposed_within_s() const;
  const TrackedFrame& at_stamp(const TrackedFrame& frame);
  bool moves() const;
  const TrackedFrame& without_fixed(const TrackedFrame& given, const TrackedFrame& frame);

  // starting.cc: from a window without states to one that has them
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
  StarterSettings starter_settings() const;
  Vec3 known_gyroscope_bias() const;

  // running.cc: one solved frame, and the images between two of them
  StepResult step(const TrackedFrame& frame, Supervisor& supervisor, const Supervisor::Effort& effort);
  bool cut(const TrackedFrame& frame);
  bool predict(const Slot& last, Slot& s) const;
  void attach(const TrackedFrame& frame);
  SolverSummary solve(Supervisor& supervisor, const Supervisor::Effort& effort);
  SolverSettings solver_settings(const Supervisor::Effort& effort) const;
  SolverSettings solver_settings(int steps) const;
  VisualSettings visual_settings() const;
  CalibrationTangent calibration_sigmas() const;
  double window_age_s() const { return (window.newest().time - flight.began_at).seconds(); }
  StepResult predict(const TrackedFrame& frame);
  StepResult predict_for_time(const TrackedFrame& frame);
  void publish(HostStamp image, const KnownState& s);

  // doubting.cc: what the images contradict
  bool doubt(bool moved, SolverSummary& s, Supervisor& supervisor, const Supervisor::Effort& effort);
  bool explain(bool moved, SolverSummary& s, Supervisor& supervisor, const Supervisor::Effort& effort);
  double cost_if_slipped(double by_s, Supervisor& supervisor, const Supervisor::Effort& effort);
  bool agree(const SolverSummary& s) const;

  // judging.cc: what a solved window is worth
  void take_from_solver(const NavState& predicted, double dt_s);
  void doubt_origin(const NavState& predicted, double dt_s);
  bool mount_is_elsewhere() const;
  void judge(const TrackedFrame& frame, const SolverSummary& s, FrameEvidence e, double dt_s);
  void learn_from_residuals(const SolverSummary& solved, double dt_s);
  void adapt_track_noise(double seen_px, double dt_s);
  void count(const SolverSummary& s);

  // sliding.cc: which frames stay
  void slide(Supervisor& supervisor);
  bool second_newest_stays() const;
  void marginalise(Supervisor& supervisor);
  void thin(int k);
  bool drop(int k);

  // resetting.cc: what ends a window, and what the next one begins with
  bool images_suffice(const TrackedFrame& frame) const;
  int seen_again(const TrackedFrame& frame) const;
  bool go_on(const TrackedFrame& frame);
  bool go_on_after_silence(const TrackedFrame& frame);
  StepResult start_anew(const TrackedFrame& frame, Supervisor& supervisor);
  StepResult begin_anew_at_rest(const TrackedFrame& frame);
  void go_on_from_carried(const TrackedFrame& frame);
  void reset();
  void forget();

  Intervals intervals{*this};
  Carrying carrying{*this, intervals};
  Wheels wheels{*this};
  Heights heights{*this};
  Resting resting{*this};
  RigNumbers numbers{*this};

  std::unique_ptr<VisualFactorModel> visual;
  Solver solver;
  Marginaliser marginaliser;
  Starter starter;

  Door door;
  Attempt attempt;
  Flight flight;
  HealthMonitor monitor;
  bool imu_gap_seen = false;  ///< since the last verdict
  /// What the last start did not know of its own place and heading (nothing in the first one), and how wrong it was
  /// where the calibration turned out to be far off.
  WorldUncertainty world;
  Odometry odometry;
};

}  // namespace epiline
