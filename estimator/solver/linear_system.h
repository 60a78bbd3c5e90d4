#pragma once
// The window's normal equations and their elimination. The arithmetic is compiled once per instruction set from
// elimination.inc; therefore nothing but plain data here. Derivation: docs/derivations/solver.md.
#include "estimator/simd/instruction_set.h"
#include "estimator/window/capacity.h"

namespace epiline {

/// Unknowns of the dense part: the poses, (v, b) of the newest frame and the calibration.
constexpr int dense_dim(int frames) { return 6 * frames + 9 + kCalibration; }
/// Where they begin: the poses oldest first.
constexpr int pose_column(int k) { return 6 * k; }
constexpr int newest_velocity_column(int frames) { return 6 * frames; }
constexpr int calibration_column(int frames) { return newest_velocity_column(frames) + 9; }
constexpr int scale_column(int frames) { return calibration_column(frames) + kCameraCalibration; }
/// The first column of P that block k of (v, b) meets, on a whole vector: the pose before it. The oldest meets the
/// prior and with it all.
constexpr int first_met(int k) { return k > 0 ? pose_column(k - 1) / kBatchLanes * kBatchLanes : 0; }
/// The last unknowns: the newest frame's state and the calibration.
constexpr int newest_column(int frames) { return pose_column(frames - 1); }

inline constexpr int kMaxChain = kMaxFrames - 1;
inline constexpr int kDenseDim = dense_dim(kMaxFrames);
inline constexpr int kDenseStride =
    (kDenseDim / kBatchLanes + 1) * kBatchLanes;  ///< of unknowns and right-hand side, in whole vectors
inline constexpr int kNewest = 15 + kCalibration;
inline constexpr int kNewestStride = 32;  ///< kNewest rounded up to whole vectors

/// The window's normal equations. Order of elimination: (v, b) of all frames but the newest (the chain), newest to
/// oldest, then the dense part.
struct alignas(64) LinearSystem {
  double S[kDenseDim][kDenseStride];     ///< the dense part, upper triangle in whole vectors, row-major
  double P[kMaxChain][9][kDenseStride];  ///< (v, b)_k against the dense part, from first_met(k) on
  double D[kMaxChain][9][16];            ///< (v, b)_k, upper triangle
  double C[kMaxChain][9][16];            ///< (v, b)_k against (v, b)_{k-1}
  double rhs_s[kDenseStride];
  double rhs_v[kMaxChain][16];
  int frames;
};

/// The step, in the order of LinearSystem.
struct alignas(64) WindowStep {
  double v[kMaxChain][16];
  double s[kDenseStride];
  double squared_length;  ///< in standard deviations: b'H^-1 b
};

struct EliminationKernels {
  /// Factorises H = U'U in place, diagonal times (1 + damping), and turns b into U^-T b. False: not positive definite.
  bool (*factorise)(LinearSystem&, double damping);
  /// With the factors: the step.
  void (*back)(const LinearSystem&, WindowStep&);
  /// With the factors: the covariance of the last kNewest unknowns.
  void (*covariance)(const LinearSystem&, double (*C)[kNewestStride]);
  /// Schur complement of the leading `lead` of `total` unknowns; A upper row-major with rows of kMarginalStride.
  void (*eliminate)(double* A, double* b, int lead, int total);
};

/// Those of an instruction set that runs here.
const EliminationKernels& elimination_kernels(InstructionSet set);

}  // namespace epiline
