#pragma once
// The whitened structureless track factor. Derivation: docs/derivations/track.md; test:
// tests/estimator/factors/visual_test.cc.
#include <memory>

#include "estimator/factors/sorted_tracks.h"
#include "estimator/factors/visual.h"

namespace epiline {

/// One factor per feature track: the 2n-3 constraints of n bearings of one unknown point on n poses, with their
/// joint covariance (docs/derivations/track.md). The point is a function of poses and bearings inside the evaluation
/// and is eliminated there. With drifting tracks a second camera's bearings of the same point count, too, and tracks of
/// other cameras (docs/derivations/several_cameras.md).
class TrackFactor final : public VisualFactorModel {
 public:
  explicit TrackFactor(InstructionSet set);
  ~TrackFactor() override;
  void collect(const Window&, const VisualSettings&) noexcept override;
  void linearise(const Window&, VisualSystem&) noexcept override;
  double cost(const Window&) noexcept override;
  void marginalise_oldest(const Window&, const VisualSettings&, VisualSystem&) noexcept override;
  bool may_step_untried() const noexcept override { return true; }  // the points are optimal at every state
  TrackFit track_fit() noexcept override;
  bool gate_suspended() const noexcept override { return gate_suspended_; }
  void restart() noexcept override;

 private:
  struct Memory;
  void fill(const Window&, int batch);
  void fill_lane(const Window&, const SortedTracks::Spanned& track, int batch, int lane);
  void place(const Window&, int frames);
  void place_others(const Window&, int frames);
  void hold_velocities(const Window&);
  void run(const Window&, VisualSystem&);
  void fetch(const Window&, const TrackRecord&) const;
  void remember_points();
  double scene() noexcept;
  void recall_point(const TrackRecord& track, int batch, int lane);

  const FactorKernels& kernels_;
  std::unique_ptr<Memory> memory_;
  TrackSettings settings_{};
  VisualSettings visual_;
  Vec3 origin_ = Vec3::Zero();  ///< of the positions handed to the kernels
  double sigma_ = 1;            ///< of a whitened number, px
  int batches_ = 0;
  int slots_ = 0;        ///< of one camera's poses
  bool others_ = false;  ///< other cameras than the first one count, too
  bool gate_suspended_ = false;
  double scene_rho_ = 0;  ///< inverse depth of most of what is seen, 1/m
  double held_m_ = 0;     ///< the way for which the velocities are held
};

}  // namespace epiline
