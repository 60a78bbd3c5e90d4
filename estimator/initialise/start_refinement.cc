#include "estimator/initialise/start_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

struct Stage {
  double kernel;  // Cauchy scale, in sigmas
  int every;      // of so many tracks one is used
};
// A wide kernel pulls from afar, and for that a third of the tracks will do; the last one forgets gross errors.
constexpr std::array<Stage, 2> kApproach = {{{32, 3}, {8, 3}}};
constexpr Stage kFinal = {2, 1};
constexpr double kDepthDamping = 0.04;             // (1/m)^-2: holds an inverse depth that the images do not see
constexpr double kDepthPrior = 0.2;                // 1/m, the inverse depth where there is no parallax at all
constexpr double kNearest = 8, kFarthest = 0.004;  // bounds of the inverse depth, 1/m
constexpr double kSpeedSigma = 10;                 // m/s: only keeps the system regular
constexpr int kInnerSteps = 2;
constexpr int kIterations = 8;       // per stage
constexpr double kConverged = 1e-4;  // relative gain that ends a stage

/// A camera: rotation and centre in B_0 with their derivatives.
struct View {
  Mat3 R;
  Vec3 c, p;
  StartRows dp;
  Mat3 dphi;  ///< by b_g alone
};

constexpr int kTurning = 5;  // column of b_g, the only one that turns cameras

using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

struct Normal {
  StartMatrix H = StartMatrix::Zero();
  StartVector b = StartVector::Zero();
  double cost = 0;
};

/// Sums over tracks. H, b: by (dp, dphi) of each frame, H its upper half only; `total`: what is already by the start's
/// tangent.
struct Accumulator {
  std::array<Mat6, kStartFrames> H;
  std::array<Vec6, kStartFrames> b;
  Normal total;

  Accumulator() {
    H.fill(Mat6::Zero());
    b.fill(Vec6::Zero());
  }
  void finish(const std::array<View, kStartFrames>& view, int frames) {
    Eigen::Matrix<double, 6, kStartDof> J = Eigen::Matrix<double, 6, kStartDof>::Zero();
    for (int k = 0; k < frames; ++k) {
      J.topRows<3>() = view[k].dp;
      J.block<3, 3>(3, kTurning) = view[k].dphi;
      H[k].bottomLeftCorner<3, 3>() = H[k].topRightCorner<3, 3>().transpose();
      total.H += J.transpose() * H[k] * J;
      total.b += J.transpose() * b[k];
    }
  }
};

/// Temporary homogeneous point (m, rho) of one track, relative to its first camera centre.
class TrackPoint {
 public:
  TrackPoint(const StartTrack& track, const std::array<View, kStartFrames>& view, double sigma, double kernel)
      : track_(track), view_(view), sigma2_(sigma * sigma), kernel2_(kernel * kernel), origin_(view[track.frame[0]].c) {
    for (int q = 0; q < track.count; ++q) f_[q] = view[track.frame[q]].R * track.f_C[q];
    m_ = f_[0];
    double num = kDepthDamping * sigma2_ * kDepthPrior, den = kDepthDamping * sigma2_;
    for (int q = 0; q < track.count; ++q) {
      const Vec3 A = f_[q].cross(origin_ - view[track.frame[q]].c);
      num -= A.dot(f_[q].cross(m_));
      den += A.squaredNorm();
    }
    rho_ = std::clamp(num / den, kFarthest, kNearest);
    // Where the images see the depth the damping must go: over a hundred tracks it would pass for knowledge of scale.
    damping_ = std::max(0.0, 2 * kDepthDamping - den / sigma2_);
  }

  void solve_point() {
    for (int n = 0; n < kInnerSteps; ++n) {
      linearise();
      const Vec3 dm = M_.llt().solve(y_);
      const double along = m_.dot(dm) / m_.squaredNorm();
      m_ += dm - along * m_;
      rho_ = std::clamp(rho_ * (1 - along), kFarthest, kNearest);
    }
    linearise();
  }

  /// Adds the track's normal equations, the point eliminated, and its robust cost.
  void add_to(Accumulator& sum) const {
    StartRows Q = StartRows::Zero();
    for (int q = 0; q < track_.count; ++q) {
      const View& v = view_[track_.frame[q]];
      const Vec3 lever = m_ + rho_ * (origin_ - v.p);
      const Mat3 L = skew(lever), WL = W_[q] * L;
      Mat6& H = sum.H[track_.frame[q]];
      H.topLeftCorner<3, 3>() += (rho_ * rho_) * W_[q];
      H.topRightCorner<3, 3>() -= rho_ * WL;
      H.bottomRightCorner<3, 3>() -= L * WL;
      Vec6& b = sum.b[track_.frame[q]];
      b.head<3>() -= rho_ * h_[q];
      b.tail<3>() -= lever.cross(h_[q]);
      Q.noalias() -= (rho_ * W_[q]).lazyProduct(v.dp);
      Q.middleCols<3>(kTurning) += WL * v.dphi;
    }
    const Mat3 C = Mat3(M_.llt().matrixL()).inverse();
    const StartRows CQ = C * Q;
    sum.total.H.noalias() -= CQ.transpose().lazyProduct(CQ);
    sum.total.b.noalias() -= CQ.transpose() * (C * y_);
    sum.total.cost += cost_;
  }

  double residual2(int q) const { return s_[q]; }

 private:
  /// Residuals in the plane tangent to each measured bearing f, their weights and the normal equations of m. With y the
  /// predicted ray scaled to f.y = 1 the residual is f - y and its derivative by m -(I - y f')/depth.
  void linearise() {
    M_ = (damping_ * rho_ * rho_ / (m_.squaredNorm() * m_.squaredNorm())) * m_ * m_.transpose();
    M_.diagonal().array() += 1e-9;
    y_.setZero();
    double product = 1;
    for (int q = 0; q < track_.count; ++q) {
      const Vec3& f = f_[q];
      const Vec3 Y = m_ + rho_ * (origin_ - view_[track_.frame[q]].c);
      const double depth = f.dot(Y);
      if (depth < 0.05) {  // behind the camera: no derivative, the cost of a gross error
        W_[q].setZero();
        h_[q].setZero();
        s_[q] = 1e6;
      } else {
        const Vec3 y = Y / depth, e = y - f;
        const double e2 = e.squaredNorm();
        s_[q] = e2 / sigma2_;
        const double w = 1 / ((1 + s_[q] / kernel2_) * depth * sigma2_);
        const Vec3 side = (0.5 * y.squaredNorm()) * f - y;
        W_[q] = (w / depth) * (Mat3::Identity() + side * f.transpose() + f * side.transpose());
        h_[q] = w * (e2 * f - e);
      }
      product *= 1 + s_[q] / kernel2_;
      M_ += W_[q];
      y_ += h_[q];
    }
    cost_ = kernel2_ * std::log(product);
  }

  const StartTrack& track_;
  const std::array<View, kStartFrames>& view_;
  double sigma2_, kernel2_;
  Vec3 origin_, m_;
  double rho_ = 0, damping_ = 0, cost_ = 0;
  Mat3 M_;
  Vec3 y_;
  std::array<Vec3, kStartFrames> f_;  ///< measured bearings in B_0
  std::array<Mat3, kStartFrames> W_;
  std::array<Vec3, kStartFrames> h_;
  std::array<double, kStartFrames> s_;
};

void place_cameras(const StartProblem& problem, const StartPath& path, const StartState& s,
                   std::array<View, kStartFrames>& view) {
  for (int k = 0; k < problem.frames; ++k) {
    View& v = view[k];
    v.p = path[k].position(s);
    v.R = path[k].R * problem.R_BC;
    v.c = v.p + path[k].R * problem.p_BC;
    v.dp = path[k].position_rows(s.g_0);
    v.dphi = path[k].rotation_rows();
  }
}

void add_prior(const StartProblem& problem, const StartState& s, Normal& n) {
  StartVector information, error = StartVector::Zero();
  information << Vec3::Constant(1 / (kSpeedSigma * kSpeedSigma)), Vec2::Zero(),
      Vec3::Constant(1 / (problem.b_g_sigma * problem.b_g_sigma)),
      Vec3::Constant(1 / (problem.b_a_sigma * problem.b_a_sigma));
  error.head<3>() = s.v_0;
  error.segment<3>(5) = s.b_g - problem.b_g_ref;
  error.tail<3>() = s.b_a;
  n.H.diagonal() += information;
  n.b -= information.cwiseProduct(error);
  n.cost += error.dot(information.cwiseProduct(error));
}

int used_tracks(const StartProblem& problem) {
  return std::min<int>(kStartTracks, static_cast<int>(problem.tracks.size()));
}

void linearise(const StartProblem& problem, const StartState& s, StartPath& path, std::array<View, kStartFrames>& view,
               const Stage& stage, Normal& n) {
  chain(problem, s.b_g, s.b_a, path);
  place_cameras(problem, path, s, view);
  Accumulator sum;
  add_prior(problem, s, sum.total);
  for (int t = 0; t < used_tracks(problem); t += stage.every) {
    if (problem.tracks[t].count < 2) continue;
    TrackPoint point(problem.tracks[t], view, problem.sigma_rad, stage.kernel);
    point.solve_point();
    point.add_to(sum);
  }
  sum.finish(view, problem.frames);
  n = sum.total;
}

/// Relative standard deviation of the path's size: the covariance of all centres along their own offsets from the
/// first.
double scale_deviation(const StartProblem& problem, const std::array<View, kStartFrames>& view,
                       const StartMatrix& covariance) {
  StartVector along = StartVector::Zero();
  double size2 = 0;
  for (int k = 1; k < problem.frames; ++k) {
    const Vec3 d = view[k].p - view[0].p;
    along += view[k].dp.transpose() * d;
    size2 += d.squaredNorm();
  }
  return std::sqrt(along.dot(covariance * along)) / std::max(size2, 1e-12);
}

/// Median of the residual lengths over 1.177, the median length of two unit Gaussians.
double typical_residual(const StartProblem& problem, const std::array<View, kStartFrames>& view, int& tracks) {
  std::array<double, kStartTracks> length;
  tracks = 0;
  for (int t = 0; t < used_tracks(problem); ++t) {
    const StartTrack& track = problem.tracks[t];
    if (track.count < 3) continue;
    TrackPoint point(track, view, problem.sigma_rad, kFinal.kernel);
    point.solve_point();
    std::array<double, kStartFrames> s;
    for (int q = 0; q < track.count; ++q) s[q] = point.residual2(q);
    std::nth_element(s.begin(), s.begin() + track.count / 2, s.begin() + track.count);
    // 2 n - 3 of 2 n degrees of freedom are left after the point is fitted
    length[tracks++] = std::sqrt(s[track.count / 2] * (2.0 * track.count) / (2.0 * track.count - 3));
  }
  if (tracks == 0) return 0;
  std::nth_element(length.begin(), length.begin() + tracks / 2, length.begin() + tracks);
  return length[tracks / 2] / 1.177;
}

/// Damped Gauss-Newton of one stage. `now` is left at the result. Returns false if the normal equations cannot be
/// solved.
bool descend(const StartProblem& problem, const Stage& stage, StartState& state, StartPath& path,
             std::array<View, kStartFrames>& view, Normal& now) {
  Normal trial;
  linearise(problem, state, path, view, stage, now);
  double damping = 1e-6;
  for (int n = 0; n < kIterations; ++n) {
    StartMatrix H = now.H;
    H.diagonal() *= 1 + damping;
    const StartVector step = H.ldlt().solve(now.b);
    if (!step.allFinite()) return false;
    const StartState candidate = moved(state, step);
    linearise(problem, candidate, path, view, stage, trial);
    if (!(trial.cost <= now.cost)) {
      damping = std::max(1e-4, damping * 30);
      continue;
    }
    const double gain = now.cost - trial.cost;
    state = candidate;
    now = trial;
    damping = std::max(1e-9, 0.1 * damping);
    if (gain < kConverged * now.cost) break;
  }
  return true;
}

}  // namespace

bool approach(const StartProblem& problem, StartState& state, StartPath& path, double& cost) {
  std::array<View, kStartFrames> view;
  Normal normal;
  for (const Stage& stage : kApproach)
    if (!descend(problem, stage, state, path, view, normal)) return false;
  cost = normal.cost;
  return true;
}

bool refine(const StartProblem& problem, StartState& state, StartPath& path, RefinementFigures& figures) {
  std::array<View, kStartFrames> view;
  Normal normal;
  if (!descend(problem, kFinal, state, path, view, normal)) return false;
  chain(problem, state.b_g, state.b_a, path);
  place_cameras(problem, path, state, view);
  const Eigen::LDLT<StartMatrix> ldlt(normal.H);
  if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) return false;
  figures.covariance = ldlt.solve(StartMatrix::Identity());
  figures.sigma_scale = scale_deviation(problem, view, figures.covariance);
  figures.residual = typical_residual(problem, view, figures.tracks);
  return figures.covariance.allFinite();
}

}  // namespace epiline
