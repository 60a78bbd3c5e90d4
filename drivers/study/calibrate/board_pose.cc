#include "drivers/study/calibrate/board_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <vector>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

struct Ray {
  Vec3 f_C;
  Vec2 q;  ///< place on the board, about zero and about 1 in size
};

/// H with f x H (q, 1) = 0 in the least squares sense, up to scale and sign.
Mat3 homography(const std::vector<Ray>& rays) {
  using Mat9 = Eigen::Matrix<double, 9, 9>;
  Mat9 A = Mat9::Zero();
  for (const Ray& ray : rays) {
    Eigen::Matrix<double, 3, 9> row;
    const Mat3 cross = skew(ray.f_C);
    row << ray.q.x() * cross, ray.q.y() * cross, cross;
    A += row.transpose() * row;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(A);  // of a fixed size it would take seconds to compile
  const Eigen::Matrix<double, 9, 1> h = eigen.eigenvectors().col(0);
  return Eigen::Map<const Mat3>(h.data());
}

std::optional<BoardPose> pose_of_rays(std::vector<Ray> rays) {
  Vec2 mean = Vec2::Zero();
  for (const Ray& ray : rays) mean += ray.q / static_cast<double>(rays.size());
  double size = 0;
  for (Ray& ray : rays) {
    ray.q -= mean;
    size += ray.q.norm() / static_cast<double>(rays.size());
  }
  if (!(size > 0)) return std::nullopt;
  for (Ray& ray : rays) ray.q /= size;
  Mat3 H = homography(rays);
  int before = 0;
  for (const Ray& ray : rays) before += ray.f_C.dot(H * ray.q.homogeneous()) > 0 ? 1 : -1;
  if (before < 0) H = -H;
  const double scale = 2 / (H.col(0).norm() + H.col(1).norm());
  if (!std::isfinite(scale)) return std::nullopt;
  H *= scale;
  BoardPose pose;
  Mat3 R;
  R << H.col(0), H.col(1), H.col(0).cross(H.col(1));
  if (!(R.determinant() > 1e-3)) return std::nullopt;
  pose.R_CT = so3_normalised(R);
  pose.t_CT = size * H.col(2) - pose.R_CT * Vec3(mean.x(), mean.y(), 0);
  return pose;
}

struct Fitted {
  double cost = 0;
  Eigen::Matrix<double, 6, 6> N = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
};

Fitted linearise(const Camera& camera, const CornerView& view, const BoardShape& shape, const BoardPose& pose,
                 double sigma_px) {
  Fitted sum;
  for (const BoardCorner& corner : view.corners) {
    const Vec3 turned = pose.R_CT * shape.place(corner);
    Vec2 px;
    Mat23 by_point;
    if (!camera.project(turned + pose.t_CT, px, &by_point)) {
      sum.cost += cauchy_cost(1e4);
      continue;
    }
    const Vec2 e = (corner.px - px) / sigma_px;
    const double weight = cauchy_weight(e.squaredNorm());
    Eigen::Matrix<double, 2, 6> J;
    J << by_point, -by_point * skew(turned);
    J /= sigma_px;
    sum.cost += cauchy_cost(e.squaredNorm());
    sum.N += weight * J.transpose() * J;
    sum.b += weight * J.transpose() * e;
  }
  return sum;
}

}  // namespace

double cauchy_cost(double squared) { return 9 * std::log1p(squared / 9); }

std::optional<BoardPose> board_pose(const Camera& camera, const CornerView& view, const BoardShape& shape,
                                    double sigma_px) {
  std::vector<Ray> rays;
  for (const BoardCorner& corner : view.corners) {
    Vec3 f_C;
    if (camera.unproject(corner.px, f_C)) rays.push_back({f_C, corner.p_T.head<2>()});
  }
  if (rays.size() < kCornersOfPose) return std::nullopt;
  auto pose = pose_of_rays(std::move(rays));
  if (!pose) return std::nullopt;
  Fitted now = linearise(camera, view, shape, *pose, sigma_px);
  for (int i = 0; i < 10; ++i) {
    now.N.diagonal() *= 1 + 1e-9;
    const Eigen::Matrix<double, 6, 1> step = now.N.ldlt().solve(now.b);
    if (!step.allFinite()) return std::nullopt;
    const BoardPose next{so3_exp(step.tail<3>()) * pose->R_CT, pose->t_CT + step.head<3>()};
    const Fitted then = linearise(camera, view, shape, next, sigma_px);
    if (!(then.cost < now.cost)) break;
    *pose = next;
    now = then;
    if (step.norm() < 1e-9) break;
  }
  return pose;
}

}  // namespace epiline
