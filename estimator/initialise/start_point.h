#pragma once
// One track's part of the joint least squares of a start: its point, and the constraint on the cameras that remains
// when the point is eliminated. Derivation: docs/derivations/initialisation.md.
#include "estimator/initialise/start_path.h"

namespace epiline {

/// A camera: rotation and centre in B_0 with their derivatives.
struct StartView {
  double T = 0;
  Mat3 R;
  Vec3 c, p;
  Eigen::Matrix<double, 3, 6> p_b;  ///< d p / d (b_g, b_a)
  Mat3 dphi;                        ///< by b_g alone
};
using StartViews = std::array<StartView, kStartFrames>;

struct StartNormal {
  StartMatrix H = StartMatrix::Zero();  ///< upper half
  StartVector b = StartVector::Zero();
  double cost = 0;
};

/// Sums over tracks.
struct StartSums {
  /// H, b of each frame's pose (dp, dphi) with the points held, H its upper half only.
  std::array<Eigen::Matrix<double, 6, 6>, kStartFrames> H;
  std::array<Eigen::Matrix<double, 6, 1>, kStartFrames> b;
  StartNormal total;  ///< terms that are already in the start's tangent

  explicit StartSums(int frames);
  /// Mean over the frames of b' H^-1 b per degree of freedom, before finish(): the squared distance in sigmas by which
  /// each pose, free by itself, would leave the path.
  double mean_score(int frames) const;
  /// Moves the poses' part into `total`.
  void finish(const StartViews& view, int frames, const Eigen::Matrix<double, 3, 2>& gravity);
};

/// A homogeneous point: seen from the first camera of its track in the direction m (in B_0), at the inverse distance
/// rho.
struct StartPoint {
  Vec3 m = Vec3::Zero();
  double rho = 0;  ///< 0: unknown
};

/// The elimination of one track's point.
class PointElimination {
 public:
  PointElimination(const StartTrack& track, const StartViews& view, double sigma, double kernel);
  /// Iterates from `start`, or from the closed form if `start` is unknown.
  void solve(const StartPoint& start, int steps);
  const StartPoint& point() const { return x_; }
  /// Adds the track's normal equations, the point eliminated, and its robust cost.
  void add_to(const Eigen::Matrix<double, 3, 2>& gravity, StartSums& sum) const;
  /// Squared residual of view q, in sigmas.
  double residual2(int q) const { return s_[q]; }

 private:
  void estimate();
  void linearise();
  void step();

  const StartTrack& track_;
  const StartViews& view_;
  double sigma2_, kernel2_, seen_ = 0;
  Vec3 origin_;
  StartPoint x_;
  double damping_ = 0, cost_ = 0;
  Mat3 M_;
  Vec3 y_;
  std::array<Vec3, kStartFrames> f_;       ///< measured bearings in B_0
  std::array<Vec3, kStartFrames> centre_;  ///< of the cameras, seen from the first
  std::array<Mat3, kStartFrames> W_;
  std::array<Vec3, kStartFrames> h_;
  std::array<double, kStartFrames> s_;
};

}  // namespace epiline
