#pragma once
// Where the factors' blocks stand in LinearSystem: the order of elimination (docs/derivations/solver.md).
#include "estimator/factors/normal_equations.h"
#include "estimator/solver/linear_system.h"

namespace epiline {

class ChainEquations final : public NormalEquations {
 public:
  explicit ChainEquations(LinearSystem& system) : s_(system) {}
  Block block(Unknown a, Unknown b) noexcept override {
    if (in_chain(a) && in_chain(b))
      return a.frame >= b.frame ? chain(a.frame, b.frame) : transposed(chain(b.frame, a.frame));
    if (in_chain(a)) return {&s_.P[a.frame][0][column(b)], kDenseStride, 1};
    if (in_chain(b)) return transposed(block(b, a));
    const int i = column(a), j = column(b);
    return i <= j ? Block{&s_.S[i][j], kDenseStride, 1} : Block{&s_.S[j][i], 1, kDenseStride};
  }
  double* rhs(Unknown a) noexcept override { return in_chain(a) ? s_.rhs_v[a.frame] : s_.rhs_s + column(a); }

 private:
  /// Of every frame but the newest.
  bool in_chain(Unknown a) const { return a.kind == Unknown::Kind::kVelocityBiases && a.frame < s_.frames - 1; }
  /// Of one frame, or of a frame and the one before it.
  Block chain(int k, int l) { return k == l ? Block{s_.D[k][0], 16, 1} : Block{s_.C[k][0], 16, 1}; }
  static Block transposed(Block b) { return {b.at, b.column, b.row}; }
  int column(Unknown a) const {
    if (a.kind == Unknown::Kind::kPose) return pose_column(a.frame);
    if (a.kind == Unknown::Kind::kVelocityBiases) return newest_velocity_column(s_.frames);
    return a.kind == Unknown::Kind::kCamera ? calibration_column(s_.frames) : scale_column(s_.frames);
  }

  LinearSystem& s_;
};

}  // namespace epiline
