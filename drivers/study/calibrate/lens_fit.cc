#include "drivers/study/calibrate/lens_fit.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/study/calibrate/lens_columns.h"
#include "estimator/geometry/so3.h"
#include "platform/math/statistics.h"

namespace epiline {

namespace {

using Mat6 = Eigen::Matrix<double, 6, 6>;
using Vec6 = Eigen::Matrix<double, 6, 1>;
constexpr std::size_t kViewsOfFit = 150;
/// Share of the cost. Small, because the numbers of a double sphere lie along a valley.
constexpr double kSettledShare = 1e-9;
/// Weight of what must not move.
constexpr double kHeld = 1e12;
/// Squared error of a corner that the lens does not see.
constexpr double kUnseen_px2 = 1e6;

/// A view of the fit with its pose.
struct Placed {
  const CornerView* view;
  BoardPose pose;
};

/// The normal equations of one view: its pose, and the pose with what all views share (the lens, behind it the board's
/// corners).
struct ViewEquations {
  Mat6 pp;
  Eigen::MatrixXd ps;
  Vec6 b;
};

class LensSolver {
 public:
  LensSolver(CameraParameters lens, BoardShape shape, std::vector<Placed> placed)
      : lens_(std::move(lens)), shape_(std::move(shape)), placed_(std::move(placed)) {}

  /// `with_shape`: the corners of the board move too.
  void run(int most, bool with_shape, bool with_lens = true) {
    with_shape_ = with_shape;
    with_lens_ = with_lens;
    sigma_px_ = median_sigma();
    double damping = 1e-3;
    linearise();
    double cost = cost_now();
    for (int i = 0; i < most && damping < 1e6; ++i) {
      const CameraParameters lens = lens_;
      const BoardShape shape = shape_;
      const std::vector<Placed> placed = placed_;
      if (!step(damping)) return;
      const double next = cost_now();
      if (next < cost) {
        damping *= 0.1;
        if (cost - next < kSettledShare * cost) break;
        sigma_px_ = std::min(sigma_px_, median_sigma());
        linearise();
        cost = cost_now();
      } else {
        lens_ = lens;
        shape_ = shape;
        placed_ = placed;
        damping *= 10;
      }
    }
    sigma_px_ = median_sigma();
  }

  /// The cost that errors of this sigma would have, those of `corners` that have no place among them, so that two fits
  /// compare.
  double cost_at(double sigma_px, std::size_t corners) {
    sigma_px_ = sigma_px;
    return cost_now() +
           static_cast<double>(corners - this->corners()) * cauchy_cost(kUnseen_px2 / (sigma_px * sigma_px));
  }

  std::size_t corners() const {
    std::size_t sum = 0;
    for (const Placed& p : placed_) sum += p.view->corners.size();
    return sum;
  }

  double median_sigma() const {
    std::vector<double> squared;
    const Camera camera(lens_);
    for (const Placed& p : placed_)
      for (const BoardCorner& corner : p.view->corners) squared.push_back(squared_error(camera, p, corner));
    // The squared error of two coordinates has its median at 2 ln 2 of one's variance.
    return std::max(std::sqrt(summarise(std::move(squared)).median / (2 * std::log(2.0))), 1e-3);
  }

  /// How large the numbers of the distortion are.
  double coefficients() const {
    double sum = 0;
    for (const double k : lens_.distortion) sum += k * k;
    return std::sqrt(sum);
  }

  const CameraParameters& lens() const { return lens_; }
  const BoardShape& shape() const { return shape_; }

 private:
  double squared_error(const Camera& camera, const Placed& p, const BoardCorner& corner) const {
    Vec2 px;
    const bool seen = camera.project(p.pose.R_CT * shape_.place(corner) + p.pose.t_CT, px);
    return seen ? (corner.px - px).squaredNorm() : kUnseen_px2;
  }

  double cost_now() const {
    const Camera camera(lens_);
    double cost = 0;
    for (const Placed& p : placed_) {
      for (const BoardCorner& corner : p.view->corners)
        cost += cauchy_cost(squared_error(camera, p, corner) / (sigma_px_ * sigma_px_));
    }
    for (int i = 0; i < shape_.corners(); ++i)
      cost += shape_.offset(i).squaredNorm() / (shape_.sigma_m() * shape_.sigma_m());
    return cost;
  }

  void linearise() {
    const LensProjection projection(lens_);
    const int columns = lens_columns(lens_.model), shared = columns + (with_shape_ ? 3 * shape_.corners() : 0);
    ss_.setZero(shared, shared);
    bs_.setZero(shared);
    if (!with_lens_) ss_.diagonal().head(columns).setConstant(kHeld);
    for (int column = columns; column < shared; column += 3) {
      const double known = 1 / (shape_.sigma_m() * shape_.sigma_m());
      ss_.diagonal().segment<3>(column).setConstant(known);
      bs_.segment<3>(column) = -known * shape_.offset((column - columns) / 3);
    }
    equations_.clear();
    for (const Placed& p : placed_) {
      ViewEquations v{Mat6::Zero(), Eigen::MatrixXd::Zero(6, shared), Vec6::Zero()};
      for (const BoardCorner& corner : p.view->corners) add(projection, p, corner, v);
      equations_.push_back(std::move(v));
    }
  }

  void add(const LensProjection& projection, const Placed& p, const BoardCorner& corner, ViewEquations& v) {
    const Vec3 turned = p.pose.R_CT * shape_.place(corner);
    Vec2 px;
    Mat23 by_point;
    LensJacobian by_lens;
    if (!projection.project(turned + p.pose.t_CT, px, by_point, by_lens)) return;
    const Vec2 e = corner.px - px;
    const double variance = sigma_px_ * sigma_px_, weight = cauchy_weight(e.squaredNorm() / variance) / variance;
    Eigen::Matrix<double, 2, 6> by_pose;
    by_pose << by_point, -by_point * skew(turned);
    const auto columns = by_lens.cols();
    v.pp += weight * by_pose.transpose() * by_pose;
    v.b += weight * by_pose.transpose() * e;
    v.ps.leftCols(columns) += weight * by_pose.transpose() * by_lens;
    ss_.topLeftCorner(columns, columns) += weight * by_lens.transpose() * by_lens;
    bs_.head(columns) += weight * by_lens.transpose() * e;
    if (!with_shape_) return;
    const Mat23 by_corner = by_point * p.pose.R_CT;
    const auto at = columns + 3 * shape_.index(corner);
    v.ps.middleCols<3>(at) += weight * by_pose.transpose() * by_corner;
    ss_.block<3, 3>(at, at) += weight * by_corner.transpose() * by_corner;
    ss_.block(at, 0, 3, columns) += weight * by_corner.transpose() * by_lens;
    bs_.segment<3>(at) += weight * by_corner.transpose() * e;
  }

  /// The damped step, the poses eliminated. False: the equations have no solution.
  bool step(double damping) {
    Eigen::MatrixXd S = ss_;  // its lower half
    S.diagonal() *= 1 + damping;
    Eigen::VectorXd s = bs_;
    // pp = L L^T of each view; L^-1 ps and L^-1 b of all views, one below the other
    std::vector<Eigen::LLT<Mat6>> factors;
    const auto rows = static_cast<Eigen::Index>(6 * equations_.size());
    Eigen::MatrixXd by_shared(rows, S.cols());
    Eigen::VectorXd right(rows);
    for (const ViewEquations& v : equations_) {
      const auto row = static_cast<Eigen::Index>(6 * factors.size());
      Mat6 pp = v.pp;
      pp.diagonal() *= 1 + damping;
      pp.diagonal().array() += 1e-12;
      factors.emplace_back(pp);
      by_shared.middleRows<6>(row) = factors.back().matrixL().solve(v.ps);
      right.segment<6>(row) = factors.back().matrixL().solve(v.b);
    }
    S.selfadjointView<Eigen::Lower>().rankUpdate(by_shared.transpose(), -1);
    s -= by_shared.transpose() * right;
    Eigen::VectorXd made = S.selfadjointView<Eigen::Lower>().ldlt().solve(s);
    if (!made.allFinite()) return false;
    const int columns = lens_columns(lens_.model);
    const CameraParameters moved = lens_with(lens_, lens_values(lens_) + made.head(columns));
    made.head(columns) = lens_values(moved) - lens_values(lens_);  // where it was held
    for (std::size_t i = 0; i < placed_.size(); ++i) {
      const Vec6 by_pose = factors[i].solve(equations_[i].b - equations_[i].ps * made);
      if (!by_pose.allFinite()) return false;
      BoardPose& pose = placed_[i].pose;
      pose.R_CT = so3_exp(by_pose.tail<3>()) * pose.R_CT;
      pose.t_CT += by_pose.head<3>();
    }
    for (int i = 0; with_shape_ && i < shape_.corners(); ++i) shape_.offset(i) += made.segment<3>(columns + 3 * i);
    lens_ = moved;
    return true;
  }

  CameraParameters lens_;
  BoardShape shape_;
  std::vector<Placed> placed_;
  bool with_shape_ = false, with_lens_ = true;
  double sigma_px_ = 1;
  Eigen::MatrixXd ss_;
  Eigen::VectorXd bs_;
  std::vector<ViewEquations> equations_;
};

/// Up to `count` views, spread over the recording, those of each part that show the most corners.
std::vector<const CornerView*> spread_views(const std::vector<CornerView>& views, std::size_t count) {
  std::vector<const CornerView*> chosen;
  const std::size_t parts = std::min(count, views.size());
  for (std::size_t part = 0; part < parts; ++part) {
    const auto from = views.begin() + static_cast<std::ptrdiff_t>(part * views.size() / parts);
    const auto to = views.begin() + static_cast<std::ptrdiff_t>((part + 1) * views.size() / parts);
    const auto best = std::max_element(
        from, to, [](const CornerView& a, const CornerView& b) { return a.corners.size() < b.corners.size(); });
    if (best->corners.size() >= kCornersOfPose) chosen.push_back(&*best);
  }
  return chosen;
}

std::vector<Placed> place(const CameraParameters& lens, const BoardShape& shape,
                          const std::vector<const CornerView*>& views) {
  const Camera camera(lens);
  std::vector<Placed> placed;
  for (const CornerView* view : views)
    if (const auto pose = board_pose(camera, *view, shape, 2)) placed.push_back({view, *pose});
  return placed;
}

/// What the fit may start from: the guess, and lenses without distortion from a wide to a narrow field of view.
std::vector<CameraParameters> starts(CameraModel model, int width, int height,
                                     const std::optional<CameraParameters>& guess) {
  std::vector<CameraParameters> list;
  if (guess && guess->model == model) list.push_back(*guess);
  for (const double share : {0.3, 0.45, 0.65, 1.0, 1.6}) {
    CameraParameters lens{model, width, height, {}, {}};
    lens.intrinsics = {share * width, share * width, 0.5 * (width - 1), 0.5 * (height - 1)};
    if (model == CameraModel::kDoubleSphere) lens.distortion = {0, 0.5};
    list.push_back(lens);
  }
  return list;
}

LensFit with_poses(const LensSolver& solver, const std::vector<CornerView>& views) {
  LensFit fit{solver.lens(), solver.shape(), solver.median_sigma(), {}};
  const Camera camera(fit.lens);
  for (const CornerView& view : views) fit.poses.push_back(board_pose(camera, view, fit.shape, fit.sigma_px));
  return fit;
}

/// A double sphere has a second valley: 281 px, 0.40, 0.749 draws what 160 px, -0.2, 0.59 draws but for 0.01 px rms.
/// Few images do not tell which is deeper, so fits this close to the best are settled on many.
constexpr double kAsGood = 1.2;
constexpr double kSameFocalLength = 0.05;
/// Twins whose costs are closer than this are not told apart by many images either: 4 sigma of independent errors, and
/// those of a corner in neighbouring images are alike. The costs of rendered boards differ by 4 to 11.
constexpr double kUndecided = 16;

/// The first that explains the corners as well as any, as far as they tell.
LensSolver& best_of(std::vector<LensSolver>& settled) {
  double sigma_px = settled.front().median_sigma();
  std::size_t corners = 0;
  for (const LensSolver& solver : settled) {
    sigma_px = std::min(sigma_px, solver.median_sigma());
    corners = std::max(corners, solver.corners());
  }
  std::vector<double> costs;
  for (LensSolver& solver : settled) costs.push_back(solver.cost_at(sigma_px, corners));
  const double undecided = *std::min_element(costs.begin(), costs.end()) + kUndecided;
  const auto best = std::find_if(costs.begin(), costs.end(), [&](double cost) { return cost <= undecided; });
  return settled[static_cast<std::size_t>(best - costs.begin())];
}

Error too_few(std::size_t views) {
  return {ErrorKind::kRun, "", 0, fmt::format("{} images that show {} corners of the board", views, kCornersOfPose),
          fmt::format("{} at least, spread over the recording", kLeastViews)};
}

/// Of twins the one with the smaller coefficients: it is nearer to a lens of one sphere.
Result<LensSolver> solve_lens(const std::vector<CornerView>& views, CameraModel model, int width, int height,
                              const std::optional<CameraParameters>& guess) {
  const auto few = spread_views(views, 15), many = spread_views(views, kViewsOfFit);
  const auto fail = [](std::string found, std::string expected) {
    return Error{ErrorKind::kRun, "", 0, std::move(found), std::move(expected)};
  };
  const BoardShape flat(views);
  std::vector<LensSolver> found;
  for (const CameraParameters& start : starts(model, width, height, guess)) {
    std::vector<Placed> placed = place(start, flat, few);
    if (placed.size() < std::min<std::size_t>(few.size(), kLeastViews)) continue;
    found.emplace_back(start, flat, std::move(placed)).run(20, false);
  }
  if (many.size() < kLeastViews) return too_few(many.size());
  std::sort(found.begin(), found.end(),
            [](const LensSolver& a, const LensSolver& b) { return a.median_sigma() < b.median_sigma(); });
  constexpr double kTooFar_px = 5;
  if (found.empty() || found.front().median_sigma() > kTooFar_px) {
    return fail(fmt::format("no {} lens explains the corners{}", name_of(model),
                            found.empty() ? "" : fmt::format(" (best: {:.1f} px off)", found.front().median_sigma())),
                "corners of the board that was described (its size, its ids), and the camera's model");
  }
  std::vector<LensSolver> settled;
  for (const LensSolver& f : found) {
    const auto is_same = [&](const LensSolver& other) {
      return std::abs(other.lens().intrinsics[0] / f.lens().intrinsics[0] - 1) < kSameFocalLength;
    };
    if (f.median_sigma() > kAsGood * found.front().median_sigma()) break;
    if (std::any_of(settled.begin(), settled.end(), is_same)) continue;
    settled.emplace_back(f.lens(), f.shape(), place(f.lens(), f.shape(), many)).run(100, true);
  }
  std::sort(settled.begin(), settled.end(),
            [](const LensSolver& a, const LensSolver& b) { return a.coefficients() < b.coefficients(); });
  return std::move(best_of(settled));
}

}  // namespace

Result<LensFit> fit_lens(const std::vector<CornerView>& views, CameraModel model, int width, int height,
                         const std::optional<CameraParameters>& guess) {
  const auto solver = solve_lens(views, model, width, height, guess);
  if (!solver) return solver.error();
  return with_poses(*solver, views);
}

Result<LensFit> fit_board(const std::vector<CornerView>& views, const CameraParameters& lens) {
  const BoardShape flat(views);
  std::vector<Placed> placed = place(lens, flat, spread_views(views, kViewsOfFit));
  if (placed.size() < kLeastViews) return too_few(placed.size());
  LensSolver solver(lens, flat, std::move(placed));
  solver.run(50, true, false);
  return with_poses(solver, views);
}

Result<LensFit> choose_lens(const std::vector<CornerView>& views, int width, int height) {
  std::vector<LensSolver> found;
  std::optional<Error> why_not;
  for (const CameraModel model :
       {CameraModel::kPinholeRadialTangential, CameraModel::kPinholeEquidistant, CameraModel::kDoubleSphere}) {
    auto solver = solve_lens(views, model, width, height, std::nullopt);
    if (solver) {
      found.push_back(std::move(*solver));
    } else if (!why_not) {
      why_not = solver.error();
    }
  }
  if (found.empty()) return *why_not;
  return with_poses(best_of(found), views);
}

}  // namespace epiline
