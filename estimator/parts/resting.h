#pragma once
// Whether the vehicle stands, and what follows for window and state. Derivation: docs/derivations/zero_motion.md.
#include "estimator/initialise/stationary_start.h"
#include "estimator/monitor/rest_detector.h"
#include "estimator/parts/common.h"
#include "estimator/parts/wheels.h"

namespace epiline {

class Resting {
 public:
  explicit Resting(Common& common) : common_(common), readings_(common.config.imu) {}
  void add(const ImuSample& reading) { readings_.add(reading); }
  void assume(const ImuNoise& noise) { readings_.assume(noise); }
  /// A window begins at its newest frame.
  void begin();
  /// The same, and the vehicle stands there.
  void begin_at_rest();
  void forget();

  /// The newest frame is at rest, its image shows that, and it was there for a while: no moment of a hover.
  bool is_seen() const;

  /// Before a start: nothing is known of the attitude.
  void watch(const TrackedFrame& frame, double pixel_sigma);
  /// What the readings of the last half second are at rest; nothing if images, readings or wheels say that it moves.
  std::optional<ImuStatistics> at_rest(WheelMotion wheels) const;

  /// The readings of the last half second are none of a vehicle that stands.
  bool is_restless() const;
  /// Noise of a bearing as the last rest shows it, with room for more, px.
  double pixel_noise() const { return images_.pixel_noise(); }

  /// Zero motion: at its first success in a place the candidate becomes a keyframe, once, and later frames at rest
  /// there are tied to it.
  void attach(const TrackedFrame& frame, double pixel_sigma, WheelMotion wheels);
  /// The window was solved.
  void solved();
  /// Whether a vehicle that stands has read for a while what its state does not explain: the biases have stepped, or
  /// what it stands on moves. Longer than images need to show that it leaves.
  bool is_contradicted(double dt_s);
  /// Readings take it away from a rest that the images still show: it leaves, or what it stands on moves.
  StateCovariance doubt_of_leaving() const;
  /// What the readings say at rest in the carried attitude; nothing if their force is beyond any bias, as in a lift.
  std::optional<RestBiases> biases() const;
  /// The frame that later ones at rest are linked to.
  std::uint64_t tied_to() const { return memory_.frame; }

 private:
  bool has_left() const;
  bool is_of_newest_frame(const ImuStatistics& read) const;
  bool is_new_place() const;
  void forget_rest(HostStamp after);

  struct Memory {
    HostStamp reference;        ///< what the images at rest are compared with
    std::uint64_t frame = 0;    ///< that later ones at rest are linked to
    bool frame_held = false;    ///< it had the attitude of the rest
    Mat3 stood = Mat3::Zero();  ///< the last attitude R_WB of which images and attitude said that nothing moved
    HostStamp stood_at, images_still_since;
    double contradicted_s = 0;
  };

  Common& common_;
  RestDetector images_;
  StationaryDetector readings_;
  Memory memory_;
};

}  // namespace epiline
