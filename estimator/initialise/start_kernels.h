#pragma once
// The arithmetic of a start's joint least squares that runs over SIMD lanes: compiled once per instruction set from
// start_point.inc, and chosen at run time. This header contains plain data only, so that no inline function is compiled
// to instructions that the machine lacks. Derivation: docs/derivations/initialisation.md.
#include "estimator/simd/instruction_set.h"

namespace epiline {

inline constexpr int kStartFrames = 21;
inline constexpr int kStartTracks = 400;
inline constexpr int kStartDof = 11;          ///< v_0, two turns of gravity, b_g, b_a
inline constexpr double kStartBehind2 = 1e6;  ///< squared residual of a point behind a camera, in squared sigmas

/// Eight tracks as a structure of arrays. An absent view is all zeros and adds nothing to any sum.
struct alignas(64) StartBatch {
  double f[kStartFrames][3][kBatchLanes];  ///< unit bearings (C), by frames
  int first, last;                         ///< frames spanned
};

/// The points of a batch: direction m (B_0) and inverse distance rho, seen from the first camera of each track.
/// rho = 0: not known.
struct alignas(64) StartPoints {
  double m[3][kBatchLanes], rho[kBatchLanes];
};

/// A frame's camera and body in B_0, and their derivatives by the start. Matrices are row-major.
struct StartCamera {
  double R[9], c[3];          ///< of the camera
  double p[3];                ///< of the body
  double T, half_T2;          ///< derivatives of p by v_0 and g_0: s since frame 0, and half its square
  double p_b_g[9], p_b_a[9];  ///< ... by the biases
  double turn_b_g[9];         ///< of the rotation, perturbed from the left
};

struct StartWeights {
  double sigma2;   ///< variance of a bearing, rad^2
  double kernel2;  ///< Cauchy scale squared, in squared sigmas
  int steps;       ///< of each point, before the equations are taken
};

/// Normal equations H delta = b of the start, the points eliminated.
struct StartEquations {
  /// What remains to be mapped to the start's unknowns: each frame's pose (dp, dphi) with the points held.
  double H_pose[kStartFrames][36], b_pose[kStartFrames][6];
  double H[kStartDof][kStartDof], b[kStartDof];  ///< the rest, in the start's unknowns; H its lower half only
  double cost;                                   ///< robust, in squared sigmas
};

struct alignas(64) StartScratch {
  double pose[kStartFrames][27][kBatchLanes];
  double H[kStartDof * (kStartDof + 1) / 2][kBatchLanes], b[kStartDof][kBatchLanes];
};

struct StartKernels {
  /// The equations of `count` batches. Their points begin at `from`, and are left in `to`. `gravity`: derivative of g_0
  /// by its two turns, 3x2.
  void (*eliminate)(const StartBatch* batches, int count, const StartCamera* cameras, int frames, const double* gravity,
                    const StartWeights&, const StartPoints* from, StartPoints* to, StartScratch&, StartEquations&);
  /// Squared residual of each view, in squared sigmas; of absent views 0.
  void (*residuals)(const StartBatch* batches, int count, const StartCamera* cameras, const StartWeights&,
                    const StartPoints* from, double (*s)[kStartFrames][kBatchLanes]);
  /// Squared sine of the widest angle between two bearings of each track, the cameras' rotation removed.
  void (*widest)(const StartBatch* batches, int count, const StartCamera* cameras, double (*sine2)[kBatchLanes]);
};

/// The kernels of an instruction set that this machine has.
const StartKernels& start_kernels(InstructionSet set);

}  // namespace epiline
