#include "drivers/study/calibrate/rig_uncertainty.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace epiline {

namespace {

/// Measurements of this time may share an error: a blur, a bias, an area of the image. As shares of the recording, but
/// for the first, s.
constexpr double kTogether_s = 1, kTogether = 0.1, kLongTogether = 0.25;
constexpr int kParts = 6;  ///< of the image in each direction

/// Sums of pulls on the constants, by what the measurements have in common.
class Clusters {
 public:
  explicit Clusters(int count) : count_(count) {}
  void add(int cluster, const Eigen::VectorXd& pull) {
    const auto [place, is_new] = sums_.try_emplace(cluster, pull);
    if (!is_new) place->second += pull;
  }
  /// Variances of the constants if clusters are independent of each other.
  Eigen::VectorXd variances() const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(count_);
    for (const auto& [cluster, pull] : sums_) sum += pull.cwiseAbs2();
    const double n = static_cast<double>(sums_.size());
    return n > 1 ? Eigen::VectorXd(sum * n / (n - 1)) : sum;
  }

 private:
  int count_;
  std::map<int, Eigen::VectorXd> sums_;
};

struct TimeClusters {
  double length_s;
  Clusters clusters;
};

/// Columns of the inverse that belong to the constants.
Eigen::MatrixXd inverse_columns(const RigLayout& layout, const FitEquations& equations) {
  const RigColumns& columns = layout.columns;
  const auto size = static_cast<Eigen::Index>(layout.first.size());
  Eigen::MatrixXd X(size, columns.count());
  for (int i = 0; i < columns.count(); ++i) {
    std::vector<double> unit(layout.first.size(), 0.0);
    unit[static_cast<std::size_t>(columns.begin + i)] = 1;
    equations.solve_again(unit);
    X.col(i) = Eigen::Map<const Eigen::VectorXd>(unit.data(), size);
  }
  return X;
}

Eigen::VectorXd pull_of(const FitResidual& r, const Eigen::MatrixXd& X) {
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(X.cols());
  for (std::size_t i = 0; i < r.count; ++i) {
    const FitResidual::Term& term = r.terms[i];
    const Vec3 gradient = -r.weight * term.J.transpose() * r.e;
    pull += X.middleRows(term.column, term.width).transpose() * gradient.head(term.width);
  }
  return pull;
}

int part_of_image(const Vec2& px, const CameraParameters& lens) {
  const auto part = [](double x, int size) { return std::clamp(static_cast<int>(kParts * x / size), 0, kParts - 1); };
  return kParts * part(px.y(), lens.height) + part(px.x(), lens.width);
}

}  // namespace

FitResidual weighted(FitResidual r, double sigma) {
  r.weight = cauchy_weight(r.e.squaredNorm() / (3 * sigma * sigma)) / (sigma * sigma);
  return r;
}

double corner_weight(const Vec2& e_px, const RigNoise& noise) {
  const double variance = noise.corner_px * noise.corner_px;
  return cauchy_weight(e_px.squaredNorm() / variance) / variance;
}

Eigen::MatrixXd covariance_of(const RigState& state, const RigLayout& layout, const FitEquations& equations,
                              const RigProblem& problem) {
  const RigFactors factors(state, layout);
  const RigColumns& columns = layout.columns;
  const Eigen::MatrixXd X = inverse_columns(layout, equations);
  Clusters corners(columns.count()), parts(columns.count());
  std::vector<TimeClusters> times;
  for (const double length_s : {kTogether_s, kTogether * state.duration_s, kLongTogether * state.duration_s})
    times.push_back({length_s, Clusters(columns.count())});
  const auto add_at = [&](double t_s, const Eigen::VectorXd& pull) {
    for (TimeClusters& time : times) time.clusters.add(static_cast<int>(std::floor(t_s / time.length_s)), pull);
  };
  for (const RigReading& reading : problem.readings) {
    add_at(reading.t_s, pull_of(weighted(factors.gyroscope(reading, 1), problem.noise.gyroscope), X) +
                            pull_of(weighted(factors.accelerometer(reading, 1), problem.noise.accelerometer), X));
  }
  const int seen = columns.gravity - columns.begin;
  for (const RigView& view : problem.views) {
    const RigFactors::View at = factors.look(view.t_s);
    Eigen::MatrixXd X_view = Eigen::MatrixXd::Zero(6 + seen, columns.count());
    for (std::size_t k = 0; k < 4; ++k) X_view.topRows<6>() += at.weight[k] * X.middleRows<6>(at.knot[k]);
    X_view.bottomRows(seen) = X.middleRows(columns.begin, seen);
    for (const Corner& corner : view.view->corners) {
      Vec2 e;
      CornerJacobian J;
      Mat23 by_corner;
      if (!factors.corner(at, corner, e, J, by_corner)) continue;
      const Vec2 weighted_e = corner_weight(e, problem.noise) * e;
      const Eigen::VectorXd pull =
          X_view.transpose() * (J.transpose() * weighted_e) +
          X.middleRows<3>(factors.column(corner)).transpose() * (by_corner.transpose() * weighted_e);
      add_at(view.t_s, pull);
      corners.add(static_cast<int>(corner.id), pull);
      parts.add(part_of_image(corner.px, state.constants.lens), pull);
    }
  }
  const Eigen::MatrixXd white = X.middleRows(columns.begin, columns.count());
  const Eigen::VectorXd least = white.diagonal();
  Eigen::VectorXd most = least.cwiseMax(corners.variances()).cwiseMax(parts.variances());
  for (const TimeClusters& time : times) most = most.cwiseMax(time.clusters.variances());
  const Eigen::VectorXd widened = (most.array() / least.array()).sqrt();
  return widened.asDiagonal() * white * widened.asDiagonal();
}

}  // namespace epiline
