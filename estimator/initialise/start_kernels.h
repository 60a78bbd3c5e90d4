#pragma once
// The arithmetic of a start that runs over SIMD lanes: compiled once per instruction set from start_point.inc and
// start_search.inc, and chosen at run time. This header contains plain data only, so that no inline function is
// compiled to instructions that the machine lacks. Derivation: docs/derivations/initialisation.md.
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

inline constexpr int kPairTracks = 64;  ///< of a pair's tracks are enough to begin from

/// Bearings of the tracks that two frames share, in their own body frames. Beyond the last track they are zero.
struct alignas(64) StartPair {
  double a[3][kPairTracks], b[3][kPairTracks];
  int tracks;
};

/// Sums over the tracks of a pair, row-major, of the robust weights times products of n = a x Rb, orthogonal to the
/// translation t, and q = Rb x (t x a), the derivative of n.t by a turn of frame j.
struct StartPairSums {
  double nn[9], nq[9], qq[9];
};

/// The linear system of the velocity v_0 and gravity g_0: A (v_0, g_0) = b, row-major.
struct StartLinear {
  double vv[9], vg[9], gg[9], v[3], g[3];
  double tracks;  ///< that it is made of
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
  /// R: frame i <- frame j. `t`: direction of the translation, a unit vector.
  void (*see_pair)(const StartPair&, const double* R, const double* t, const StartWeights&, StartPairSums&);
  /// Only `nn`. `t` may be null: all weights are 1.
  void (*see_normals)(const StartPair&, const double* R, const double* t, const StartWeights&, StartPairSums&);
  /// Of tracks of three views or more whose widest angle has a squared sine of `least` or more. The cameras are where
  /// v_0 = g_0 = 0 puts them. `at`: the centres that give each row its noise; null: not known yet.
  void (*see_linear)(const StartBatch* batches, int count, const StartCamera* cameras, double least, double sigma,
                     const double (*at)[3], StartLinear&);
};

/// The kernels of an instruction set that this machine has.
const StartKernels& start_kernels(InstructionSet set);

}  // namespace epiline
