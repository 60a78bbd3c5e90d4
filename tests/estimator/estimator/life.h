#pragma once
// Flights with what life has: tracks that are born and die, waits, speed, vibration, own parts and traffic in the view,
// wrong numbers, bad timestamps, silences. Each is a switch, and value 0 of each switch is the harmless one.
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "estimator/estimator.h"
#include "pipeline/watch/burst_stamps.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {

enum Switch : std::uint8_t {
  kPath,
  kWait,
  kBreak,
  kNumber,
  kView,
  kEvent,
  kVibration,
  kWarming,
  kImuStamps,
  kImages,
  kLife,
  kNoise,
  kSwitches
};
enum Path : std::uint8_t { kRoom, kStand, kHover, kDash, kTurn, kRoad, kCruise };
enum Wait : std::uint8_t { kShortWait, kLongWait, kInMotion };
enum Number : std::uint8_t {
  kRight,
  kFocalOff,
  kLeverOff,
  kTurned,
  kStampsOff,
  kForceScale,
  kRateScale,
  kTenfold,
  kTenth
};
enum View : std::uint8_t { kClean, kOwnParts, kLorry, kPerson, kLift };
enum Mishap : std::uint8_t { kNone, kCameraShort, kCameraLong, kImuShort, kImuLong, kBlow };
enum Vibration : std::uint8_t { kSmooth, kBeforeTakeOff, kAlways };

/// Of each switch its name, and those of its values.
struct SwitchNames {
  const char* name;
  std::vector<const char*> values;
};
const std::array<SwitchNames, kSwitches>& switch_names();

using Row = std::array<std::uint8_t, kSwitches>;
/// Only what is not harmless.
std::string to_string(const Row& row);

/// What the vehicle does. World: z up. Body: x ahead.
class LifeMotion {
 public:
  explicit LifeMotion(const Row& row);
  /// From `at_s` on it gathers speed, or slows down if it moves; later than the change before has ended.
  void change(double at_s);

  double lift_from_s = std::numeric_limits<double>::max();  ///< the room around it goes up, for 8 s
  double blow_from_s = std::numeric_limits<double>::max();  ///< it is hit, and rings for 0.1 s ...
  Vec3 blow_axis = Vec3::Zero();                            ///< ... along this axis of the world
  double nearest_m = 2.5, farthest_m = 10;                  ///< of what is seen
  double gather_s = 1;                                      ///< how long a change takes

  Vec3 p(double t) const;  ///< in what is seen
  Mat3 R(double t) const;
  Vec3 v(double t) const;         ///< in what is seen
  double lifted(double t) const;  ///< what is seen, in the world, m
  double lifting(double t) const;
  Vec3 rate(double t) const;
  Vec3 force(double t) const;

 private:
  struct Change {
    double at_s, along;
    bool faster;
  };
  const Change& last_change(double t) const;
  double along(double t) const;
  double pace(double t) const;  ///< of `along`
  bool stands(double t) const;
  Vec3 on_path(double t) const;
  Vec3 blown(double t) const;
  Vec3 world_p(double t) const { return p(t) + Vec3(0, 0, lifted(t)); }

  Path path_;
  std::vector<Change> changes_{{-100, 0, false}};  ///< longer ago positions would be rounded
};

/// An estimator, and the sensors of a vehicle that flies a row: IMU at 200 Hz, its bursts straightened as the pipeline
/// does, images at 20 Hz with 120 tracks.
class LifeRig {
 public:
  struct Span_s {
    double from, to;
  };
  /// With the row's own waits and breaks, or standing: then the caller changes `motion`.
  LifeRig(const Row& row, unsigned seed, bool stands = false);

  LifeMotion motion;
  Vec3 bias_step = Vec3::Zero();   ///< of the gyroscope, rad/s ...
  Vec3 force_step = Vec3::Zero();  ///< ... and of the accelerometer, m/s^2 ...
  double bias_steps_at_s = 0;      ///< ... from then on
  double stamps_step_s = 0;        ///< later are those of the images ...
  double stamps_step_at_s = 0;     ///< ... from then on
  Span_s blind{1e9, 1e9};          ///< without images
  Span_s rings{1e9, 1e9};  ///< both sensors read nonsense up to 5 rad/s and their limit, as after a hard landing
  double distortion = 0;   ///< that nobody has calibrated: radius times 1 + so much of its square, unit depth
  /// Until `seconds`; `each` after every frame that was processed.
  void run_to(double seconds, const std::function<void(const StepResult&)>& each = {});
  double now() const { return 0.05 * frame_; }
  double ends_at() const { return ends_at_s_; }
  /// What disturbs for a while. The first: it has yet to start, which on the road lasts.
  const std::vector<Span_s>& causes() const { return causes_; }
  const Estimator& estimator() const { return *estimator_; }
  Estimator& estimator() { return *estimator_; }
  std::uint64_t heap_calls() const { return heap_calls_; }  ///< of the estimator, since it was made

 private:
  enum class Kind : std::uint8_t { kWorld, kOwn, kLorry, kPerson };
  struct Track {
    std::uint32_t id, age;
    Kind kind;
    Vec3 X;  ///< in the world, in that of the body at the time of its beginning, or in the camera
    double dies_at_s;
    Vec2 seen, drift;  ///< px, without noise; of the tracker
  };
  struct Body {
    double from_s = 0;
    Vec3 v = Vec3::Zero();
  };
  void schedule(bool stands);
  void shake();
  EstimatorConfig config();
  bool lorry_is_there(double t) const { return t >= lorry_from_s_ && t < lorry_from_s_ + 5; }
  Vec3 in_camera(const Track& track, double t) const;
  bool is_seen(const Track& track, double t) const;
  Track born(Kind kind, double t);
  void fill(std::size_t wanted, Kind kind, double t);
  void renew_tracks(double t);
  void observe(double t);
  Vec3 shaken(int sensor, double t) const;
  void push_imu(int k);

  bool is(Switch s, int value) const { return row_[s] == value; }
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  double exponential(double mean) { return std::exponential_distribution<double>(1 / mean)(random_); }
  Vec2 normal2(double sigma) { return sigma * Vec2(normal_(random_), normal_(random_)); }
  Vec3 normal3(double sigma) { return sigma * Vec3(normal_(random_), normal_(random_), normal_(random_)); }

  Row row_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Calibration calibration_ = synthetic_calibration();
  double sign_ = 1;  ///< of what is wrong
  std::unique_ptr<Estimator> estimator_;
  Supervisor patient_;
  std::vector<Span_s> causes_;
  double ends_at_s_ = 0;
  double lorry_from_s_ = 1e9, person_from_s_ = 0, vibrates_from_s_ = 1e9;
  Span_s unfelt_{1e9, 1e9};
  Body lorry_, person_;
  static constexpr int kTones = 6;
  std::array<double, kTones> tone_rad_s_{};
  std::array<std::array<Vec3, kTones>, 2> tone_{}, tone_phase_{};  ///< of gyroscope and accelerometer
  std::vector<Track> tracks_;
  std::uint32_t next_id_ = 0;
  TrackedFrame image_;
  BurstStamps bursts_;
  int frame_ = 0, imu_ = 0;
  std::uint64_t heap_calls_ = 0;
};

/// Of position, velocity, yaw and tilt the largest error over its claimed sigma, now, in the frame to which the claims
/// refer; what: p, v, y, t.
struct LifeError {
  double sigmas = 0, error = 0;
  char what = '-';
};
LifeError worst_error(const LifeRig& rig);

/// Does `tracking` tell the truth, does it come back, and does it accuse nobody wrongly?
struct LifeVerdict {
  static constexpr double kSigmas = 3.5;
  double worst = 0;  ///< error over claimed sigma while tracking, 3 s or more after the first pose of each reset
  char what = '-';   ///< p, v, y, t: position, velocity, yaw, tilt
  double worst_error = 0, worst_at_s = 0;
  int judged = 0, wrong = 0;     ///< poses; those beyond kSigmas
  double lost_at_s = -1;         ///< without a pose, though nothing had happened for 5 s
  double not_back_after_s = -1;  ///< the end of what disturbed it, after which it was not back within 5 s
  double first_pose_s = -1, tracking_share = 0, cpu_s = 0;
  std::uint64_t resets = 0;
  std::string guilty, innocent;  ///< words at kSuspect or above, which name a part that is wrong, and one that is not

  bool is_wrong() const { return wrong > 0; }
  bool is_late() const { return lost_at_s >= 0 || not_back_after_s >= 0 || is_mute(); }
  /// No pose could be judged, and no word says what is wrong.
  bool is_mute() const { return judged == 0 && guilty.empty(); }
  bool passes() const { return !is_wrong() && !is_late() && innocent.empty(); }
  /// Fails in each of the ways in which the other one fails.
  bool fails_like(const LifeVerdict& other) const {
    return (is_wrong() || !other.is_wrong()) && (is_late() || !other.is_late()) &&
           (!innocent.empty() || other.innocent.empty());
  }
};
std::string to_string(const LifeVerdict& verdict);

/// Flies a row and judges it.
LifeVerdict fly(const Row& row, unsigned seed);

/// The row with as many switches harmless as possible that still fails like this one.
Row smallest(Row row, unsigned seed, const LifeVerdict& verdict);

/// A table in which every pair of values of two switches occurs, but for those that cannot be flown. In a row at most
/// two things are wrong, so that the one does not hide the other's failure: path, waits, and tracks' life and noise are
/// not wrong.
std::vector<Row> pairwise_table(unsigned seed);

/// Each path and wait, harmless and with each value of one other switch, but for those that cannot be flown.
std::vector<Row> single_table();

}  // namespace epiline::test
