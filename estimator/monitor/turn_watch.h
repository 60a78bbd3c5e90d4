#pragma once
// Compares the rotations of camera and gyroscope, independently of the estimate, to check time offset, relative
// rotation, units and axes. Derivation: docs/derivations/turns.md; test: tests/estimator/monitor/turn_watch_test.cc.
#include <array>
#include <cstdint>
#include <optional>

#include "estimator/geometry/types.h"
#include "estimator/monitor/turn_between.h"
#include "platform/samples/samples.h"

namespace epiline {

struct TurnAgreement {
  double turned_s = 0;       ///< time during which images were compared; fades with the watch's memory
  double turns = 0;          ///< number of pairs of images; fades
  double rate_rad_s = 0;     ///< root mean square of the camera's turns about their mean
  double agreement = 0;      ///< correlation of both after the fit: 1 is perfect, 0 is chance
  double time_offset_s = 0;  ///< t_IMU = t_image + time_offset
  double offset_loss = 0;    ///< loss of agreement at the middle one of the offsets searched
  Mat3 R_BC = Mat3::Identity();
  Mat3 R_BC_covariance = Mat3::Zero();  ///< of its perturbation on the right, rad^2, axes of C
  double weakest_axis = 0;              ///< rotation about the least turned axis over that about the most turned one
  double rate_ratio = 1;                ///< the gyroscope's rates over the camera's
  // Fit of a reflection instead of a rotation: an axis with the wrong sign, or two axes swapped.
  double agreement_mirrored = 0;
  Mat3 mirrored_BC = Mat3::Identity();  ///< orthogonal, determinant -1
};

class TurnWatch {
 public:
  /// `memory_s`: age at which rotations have weight 1/e; `reach_s`: range of offsets searched around `time_offset_s`.
  TurnWatch(double time_offset_s, double memory_s);

  /// Compares the image with the previous one if that is at most 0.5 s older. Features may come in any order.
  void add_images(const TrackedFrame& frame) noexcept;
  /// As if no image had been compared yet.
  void forget() noexcept;
  /// Adds a sample; call in time order.
  void add_reading(const ImuSample& reading) noexcept;
  /// Bounded work, no heap. With fewer than 30 rotations only their number and duration are valid.
  TurnAgreement agreement() const noexcept;
  /// Typical distance of bearings from the epipolar planes of the best motion between two images, rad, over the last
  /// seconds. It is the tracks' error as far as the camera alone can observe it.
  double noise_rad() const noexcept;

 private:
  static constexpr int kOffsets = 63, kMiddle = kOffsets / 2;
  static constexpr double kStep_s = 0.008;  ///< between two offsets searched
  static constexpr Span kReach = Span::from_milliseconds(248);
  static constexpr std::uint32_t kIntegrals = 1024, kPending = 32;

  struct Seen {
    std::uint32_t id;
    Vec3 f_C;
  };
  struct Turn {
    HostStamp from, to;  ///< by the image's clock
    Vec3 rate_C;         ///< mean, rad/s
  };
  struct Integral {
    HostStamp stamp;
    Vec3 angle_B;  ///< integral of the rates since the first reading
  };
  /// Weighted sums over the turns, for one offset; the gyroscope's mean rate is b, the camera's c.
  struct Sums {
    Vec3 b = Vec3::Zero();
    Mat3 bc = Mat3::Zero();
    double bb = 0;
  };
  struct Fit {
    double agreement = -1;
    Mat3 sum = Mat3::Zero();  ///< of b c^T about the means
    double bb = 0, cc = 0;    ///< about the means
  };

  const Vec3* bearing_before(std::uint32_t id) const noexcept;
  void integrate(const ImuSample& reading) noexcept;
  void use_turns() noexcept;
  void use(const Turn& turn) noexcept;
  std::optional<std::uint32_t> integral_at(HostStamp stamp) const noexcept;
  Vec3 angle_at(HostStamp stamp, std::uint32_t& from) const noexcept;
  Fit fit_at(int offset) const noexcept;

  const TurnKernels& kernels_;
  Span offset_;
  double memory_s_;

  SharedBearings shared_;
  Vec3 rate_C_ = Vec3::Zero(), direction_ = Vec3::UnitX();  ///< of the last pair that fitted, rad/s
  HostStamp last_stamp_;
  int seen_count_ = 0;
  std::array<Seen, kMaxFeatures> seen_;

  std::array<Turn, kPending> pending_;  ///< rotations that wait for later IMU samples
  std::uint32_t pending_first_ = 0, pending_end_ = 0;

  std::array<ImuSample, 3> newest_;  ///< of the readings: their median is integrated
  int readings_ = 0;
  HostStamp integrated_to_;
  Vec3 rate_ = Vec3::Zero(), angle_ = Vec3::Zero();
  std::array<Integral, kIntegrals> integral_;
  std::uint32_t integral_end_ = 0;

  double cost_ = 0;         ///< of a pair of images, over the last ones
  std::uint32_t fits_ = 0;  ///< of pairs
  // faded sums
  HostStamp faded_to_;
  double turned_s_ = 0, turns_ = 0, cc_ = 0;
  Vec3 c_ = Vec3::Zero();
  std::array<Sums, kOffsets> sums_;
};

}  // namespace epiline
