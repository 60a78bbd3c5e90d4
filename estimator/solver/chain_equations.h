#pragma once
// Where the factors' blocks stand in LinearSystem: the order of elimination (docs/derivations/solver.md).
#include "estimator/factors/normal_equations.h"
#include "estimator/solver/linear_system.h"

namespace epiline {

class ChainEquations final : public NormalEquations {
 public:
  explicit ChainEquations(LinearSystem& system) : s_(system) {}
  Block block(Unknown a, Unknown b) noexcept override {
    const bool a_velocity = a.kind == Unknown::Kind::kVelocityBiases,
               b_velocity = b.kind == Unknown::Kind::kVelocityBiases;
    if (a_velocity && b_velocity)
      return a.frame >= b.frame ? chain(a.frame, b.frame) : transposed(chain(b.frame, a.frame));
    if (a_velocity) return {&s_.P[a.frame][0][column(b)], kPoseStride, 1};
    if (b_velocity) return transposed(block(b, a));
    const int i = column(a), j = column(b);
    return i <= j ? Block{&s_.S[i][j], kPoseStride, 1} : Block{&s_.S[j][i], 1, kPoseStride};
  }
  double* rhs(Unknown a) noexcept override {
    return a.kind == Unknown::Kind::kVelocityBiases ? s_.rhs_v[a.frame] : s_.rhs_s + column(a);
  }

 private:
  /// Of one frame, or of a frame and the one before it.
  Block chain(int k, int l) { return k == l ? Block{s_.D[k][0], 16, 1} : Block{s_.C[k][0], 16, 1}; }
  static Block transposed(Block b) { return {b.at, b.column, b.row}; }
  int column(Unknown a) const {
    if (a.kind == Unknown::Kind::kPose) return pose_column(s_.frames, a.frame);
    return a.kind == Unknown::Kind::kCamera ? 6 * s_.frames : scale_column(s_.frames);
  }

  LinearSystem& s_;
};

}  // namespace epiline
