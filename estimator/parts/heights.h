#pragma once
// The sensors of height, from their readings to the window. Derivation: docs/derivations/height.md.
#include <array>

#include "estimator/inertial/scalar_history.h"
#include "estimator/parts/common.h"

namespace epiline {

class Heights {
 public:
  /// What they have shown of offsets and ground, in this world.
  struct Memory {
    std::array<std::uint32_t, kHeightKinds> series{};  ///< the newest of each sensor
    std::array<std::uint32_t, 256> beam_tracks{};      ///< that have served frames that have left
    std::size_t beam_tracks_served = 0;
    double ground_step_m = 0, ground_step_at_m = 0;  ///< the last jump of the range finder, and the way up to there
  };

  explicit Heights(Common& common) : common_(common) {}
  /// False: it is left out.
  bool add(const HeightSample& sample);
  bool has_range_finder() const { return readings_[static_cast<std::size_t>(HeightKind::kRangeFinder)].any(); }
  /// As speeds of wheels are: frames between two samples get a height, once. `pixel_sigma`: of the bearings, px.
  void attach(double pixel_sigma);
  /// The oldest frame is about to leave. Its tracks near the beam have served: each does so once.
  void remember_oldest();
  const Memory& memory() const { return memory_; }
  void restore(const Memory& memory) { memory_ = memory; }
  void forget() { memory_ = {}; }

 private:
  void measure_path();
  std::uint32_t series_of(HeightKind kind, int frame) const;
  void note_ground_step(int frame);
  void attach_beam_tracks(double pixel_sigma);

  /// Heights further apart in time are not interpolated.
  static constexpr Span kInterval = Span::from_milliseconds(500);
  Common& common_;
  std::array<ScalarHistory, kHeightKinds> readings_{ScalarHistory{kInterval}, ScalarHistory{kInterval}};
  Memory memory_;
};

}  // namespace epiline
