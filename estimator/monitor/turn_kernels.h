#pragma once
// The arithmetic of a camera's turn that runs over SIMD lanes: compiled once per instruction set from turn_kernels.inc,
// and chosen at run time. This header contains plain data only, so that no inline function is compiled to instructions
// that the machine lacks. Derivation: docs/derivations/turns.md.
#include "estimator/simd/instruction_set.h"

namespace epiline {

inline constexpr int kMostShared = 64;  ///< bearings

/// Unit vectors in C, zero beyond those that are there: such a bearing adds nothing to any sum. Single precision is
/// finer than a thousandth of their noise, and twice as many fit a vector.
struct alignas(64) BearingRows {
  float x[kMostShared], y[kMostShared], z[kMostShared];
};

/// Bearings g of an earlier image, turned, and how far they are off the planes of direction t and bearing f now.
struct alignas(64) EpipolarAngles {
  BearingRows g;
  float scale[kMostShared];  ///< 1 / |t x f|
  float e[kMostShared];      ///< -scale (t x f)'g, rad
};

/// How far points moved along their epipolar lines, and its slopes by a plane n'X = 1 in the earlier camera.
struct alignas(64) Parallaxes {
  BearingRows by_plane;
  float seen[kMostShared];
};

inline constexpr float kCostScale_rad = 1e-3F;
inline constexpr float kLeastMoved = 1e-3F;  ///< sine: a bearing along the travel shows no parallax

/// Costs are sums of log(1 + (e/kCostScale_rad)^2), weights 1/(1 + (e/kCostScale_rad)^2). Matrices are row-major.
struct TurnKernels {
  /// `R`: f ~ R before, `t`: the direction of travel, a unit vector. Returns the cost of the angles.
  double (*look)(const BearingRows& before, const BearingRows& now, const double* R, const double* t, EpipolarAngles&);
  /// Normal equations of a turn (3) on the left and of the direction along the two unit vectors `across` (2x3) it: the
  /// lower triangle of H, row by row, and b.
  void (*equations)(const BearingRows& now, const EpipolarAngles&, const double* t, const double* across, double* H,
                    double* b);
  void (*parallaxes)(const BearingRows& before, const BearingRows& now, const double* R, const double* t, Parallaxes&);
  /// Normal equations of the plane at n, as above; with no n all weights are 1. Returns the cost at n.
  double (*plane)(const Parallaxes&, const double* n, double* H, double* b);
};

/// The kernels of an instruction set that this machine has.
const TurnKernels& turn_kernels(InstructionSet set);

}  // namespace epiline
