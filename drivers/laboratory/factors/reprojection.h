#pragma once
// Reprojection with landmarks in the state, as in VINS-Mono. Derivation: docs/derivations/reprojection.md; test:
// tests/drivers/laboratory/factors/reprojection_test.cc.
#include <memory>

#include "drivers/laboratory/factors/kernels.h"
#include "estimator/factors/visual.h"

namespace epiline {

/// The position of a point, which an estimator with a map keeps from frame to frame and a structureless one does not.
struct Landmark {
  std::uint32_t track = 0;  ///< id
  std::uint64_t host = 0;   ///< id of the frame on whose bearing it lies, exactly; 0: no depth yet
  std::uint64_t since = 0;  ///< views of older frames do not count, because the landmark failed then and began again
  double inverse_distance = 0;  ///< from the host's camera along that bearing, 1/m
};

/// For comparison: each bearing except the host's against the projected landmark, 1.5 px, Huber(1). The inverse
/// distances are unknowns of the joint problem: eliminated by Schur complement, changed with every step of the solver
/// and restored with it, passed from host to host. VINS-Mono's rules, with its double use at marginalisation.
class ReprojectionFactor final : public VisualFactorModel {
 public:
  explicit ReprojectionFactor(InstructionSet set);
  ~ReprojectionFactor() override;
  void collect(const Window&, const VisualSettings&) noexcept override;
  void linearise(const Window&, VisualSystem&) noexcept override;
  double cost(const Window&) noexcept override;
  /// All bearings of the landmarks hosted in frame 0, over frames 0..n-2; then hands those landmarks to their next
  /// host.
  void marginalise_oldest(const Window&, const VisualSettings&, VisualSystem&) noexcept override;
  bool prior_reaches_newest() const noexcept override { return true; }
  int unknowns() const noexcept override { return used_; }
  void save() noexcept override;
  void step(const Window& moved) noexcept override;
  void restore() noexcept override;
  void restart() noexcept override { count_ = 0; }

  /// The landmark of the window's track i at the last collect().
  Landmark& landmark(int i);

 private:
  struct Memory;
  void follow_tracks(const Window&);
  void pack(const Window&, int frames, int host_limit);
  void load_depths();
  void run(const Window&, int frames, VisualSystem&);
  void shift_host(const Window&, int track);

  std::unique_ptr<Memory> memory_;
  const FactorKernels& common_;  ///< what all visual factors need
  const LaboratoryKernels& kernels_;
  VisualSettings settings_;
  int count_ = 0;  ///< landmarks, one per track
  int used_ = 0, batches_ = 0;
};

}  // namespace epiline
