#pragma once
// The arithmetic of the compared factors over SIMD lanes: compiled once per instruction set from epipolar.inc and
// reprojection.inc, as the estimator's is (estimator/factors/kernels.h). Plain data.
#include "estimator/factors/kernels.h"

namespace epiline {

/// Tracks of the epipolar factor, eight to a batch, frame by frame: normalised image coordinates (x, y, 1). An absent
/// view is all zeros and adds nothing to any sum.
struct alignas(64) EpipolarViews {
  double z[kMaxFrames][kMaxBatches][3][kBatchLanes];
  int first[kMaxBatches], last[kMaxBatches];  ///< frames spanned; sorted by the first
};

/// Each batch of landmarks has one host; every host may have one batch that is not full.
inline constexpr int kLandmarkBatches = kMaxBatches + kMaxFrames;

/// Work space of the reprojection factor and of its depths' own step.
struct alignas(64) LandmarkScratch {
  double rows[kMaxFrames][kBatchesAtOnce][6][kBatchLanes];  ///< H_rho,k over the root of H_rho,rho, host included
  double e[kMaxFrames][kLandmarkBatches][3][kBatchLanes];   ///< W_k d_k
  double D[kMaxFrames][27][kBatchLanes];
  double gradient[kLandmarkBatches][kBatchLanes];   ///< of the depth: the right-hand side of its own equation
  double curvature[kLandmarkBatches][kBatchLanes];  ///< H_rho,rho
};

struct LaboratoryKernels {
  /// Adds the epipolar residuals of all pairs among the first `frame_count` frames, or of those that contain frame 0,
  /// to zeros. `scale`: pixels over sigma. Perturbed about the common origin, as landmarks are.
  void (*epipolar)(const EpipolarViews&, int count, const FrameGeometry* frames, int frame_count, double scale,
                   bool oldest_only, VisualSystem&);
  /// Their cost alone.
  double (*epipolar_cost)(const EpipolarViews&, int count, const FrameGeometry* frames, int frame_count, double scale);
  /// Linearises landmarks at the inverse distances `rho` along their hosts' bearings (each batch's `first` frame) and
  /// eliminates them. Rotations and positions are perturbed about the common origin: q(dp, dphi) = (dp + p x dphi,
  /// dphi). Curvatures of rho below `damping` are raised to it.
  void (*landmarks)(const TrackBatch* batches, const double (*rho)[kBatchLanes], int count, const FrameGeometry* frames,
                    int frame_count, double damping, LandmarkScratch&, VisualSystem&);
  /// Their cost alone.
  double (*landmark_cost)(const TrackBatch* batches, const double (*rho)[kBatchLanes], int count,
                          const FrameGeometry* frames);
  /// The landmarks' part of a step: changes of rho for cameras displaced by `motion` (dc, dphi) from their poses in
  /// landmarks().
  void (*landmark_step)(const TrackBatch* batches, const double (*rho)[kBatchLanes], int count,
                        const FrameGeometry* frames, const double (*motion)[6], const LandmarkScratch&,
                        double (*change)[kBatchLanes]);
};

/// The kernels of an instruction set that this machine has.
const LaboratoryKernels& laboratory_kernels(InstructionSet set);

}  // namespace epiline
