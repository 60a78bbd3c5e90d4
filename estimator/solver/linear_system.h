#pragma once
// The window's normal equations and their elimination. The arithmetic is compiled once per instruction set from
// elimination.inc; therefore nothing but plain data here. Derivation: docs/derivations/solver.md.
#include "estimator/simd/instruction_set.h"
#include "estimator/window/capacity.h"

namespace epiline {

inline constexpr int kPoseStride = 136;  ///< kPoseDim rounded up to whole vectors

/// The window's normal equations. Order of elimination: (v, b) newest to oldest, then poses newest first, then
/// calibration.
struct alignas(64) LinearSystem {
  double S[kPoseDim][kPoseStride];       ///< upper triangle, row-major
  double P[kMaxFrames][9][kPoseStride];  ///< (v, b)_k against poses and calibration
  double D[kMaxFrames][9][16];           ///< (v, b)_k, upper triangle
  double C[kMaxFrames][9][16];           ///< (v, b)_k against (v, b)_{k-1}
  double rhs_s[kPoseStride];
  double rhs_v[kMaxFrames][16];
  int frames;
  int pose_dim() const;
};

/// Column of S where frame k's pose begins: newest first.
constexpr int pose_column(int frames, int k) { return 6 * (frames - 1 - k); }
/// Column of S where the scales of the IMU begin. Every (v, b)_k meets them.
constexpr int scale_column(int frames) { return 6 * frames + kCameraCalibration; }

/// Right-hand sides and solutions, rows in the order of LinearSystem.
struct alignas(64) StepColumns {
  double v[kMaxFrames][9][16];  ///< column 0: b; columns 1 to 15: the newest frame's pose, velocity and biases
  double s[kPoseDim][16];
  double step_v[kMaxFrames][16];
  double step_s[kPoseStride];
  double squared_length;  ///< of column 0
};

struct EliminationKernels {
  /// Factorises in place, diagonal times (1 + damping). False: not positive definite.
  bool (*factorise)(LinearSystem&, double damping);
  /// With the factors U: x = U^-T (b, E), E the newest frame's unknowns, and |U^-T b|^2.
  void (*forward)(const LinearSystem&, StepColumns&);
  /// The step U^-1 x of the first column.
  void (*back)(const LinearSystem&, StepColumns&);
  /// (U^-T E)'(U^-T E) into the leading 15x15 of a 16x16 matrix.
  void (*products)(const LinearSystem&, const StepColumns&, double* C);
  /// Schur complement of the leading `lead` of `total` unknowns; A upper row-major with rows of kMarginalStride.
  void (*eliminate)(double* A, double* b, int lead, int total);
};

/// Those of an instruction set that runs here.
const EliminationKernels& elimination_kernels(InstructionSet set);

}  // namespace epiline
