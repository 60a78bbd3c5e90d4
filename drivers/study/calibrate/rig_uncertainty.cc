#include "drivers/study/calibrate/rig_uncertainty.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

namespace epiline {

namespace {

/// Measurements of this time may share an error: a blur, a bias, an area of the image. As shares of the recording, but
/// for the first, s.
constexpr double kTogether_s = 1, kTogether = 0.1, kLongTogether = 0.25;
constexpr int kParts = 6;  ///< of the image in each direction
/// Standard deviations beyond which a term is not chance; one exact lens in 200 has one of the two beyond.
constexpr double kNotByChance = 3;

/// Sums of pulls on the constants, by what the measurements have in common.
class Clusters {
 public:
  explicit Clusters(int count) : count_(count) {}
  void add(int cluster, const Eigen::VectorXd& pull) {
    const auto [place, is_new] = sums_.try_emplace(cluster, pull);
    if (!is_new) place->second += pull;
  }
  /// Variances of the sums over all clusters if these are independent of each other and expect zero.
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

using TermMatrix = Eigen::Matrix<double, kLensTerms, kLensTerms>;
using TermVector = Eigen::Matrix<double, kLensTerms, 1>;

/// A corner's part in the equations.
struct SeenCorner {
  double t_s;
  const RigFactors::View& at;
  const BoardCorner& corner;
  Vec2 px, e;  ///< projected; measured minus projected
  const CornerJacobian& J;
  const Mat23& by_corner;
  double weight;
};

int part_of_image(const Vec2& px, const CameraParameters& lens) {
  const auto part = [](double x, int size) { return std::clamp(static_cast<int>(kParts * x / size), 0, kParts - 1); };
  return kParts * part(px.y(), lens.height) + part(px.x(), lens.width);
}

/// The work of uncertainty_of().
class Uncertainty {
 public:
  Uncertainty(const RigState& state, const RigLayout& layout, const FitEquations& equations, const RigProblem& problem)
      : state_(state),
        columns_(layout.columns),
        equations_(equations),
        problem_(problem),
        factors_(state, layout),
        size_(static_cast<Eigen::Index>(layout.first.size())),
        constants_(columns_.count()),
        seen_(columns_.gravity - columns_.begin) {
    for (const double length_s : {kTogether_s, kTogether * state.duration_s, kLongTogether * state.duration_s})
      times_.push_back({length_s, Clusters(constants_ + kLensTerms)});
  }

  RigUncertainty run() {
    X_.resize(size_, constants_);
    for (int i = 0; i < constants_; ++i) X_.col(i) = solved(Eigen::VectorXd::Unit(size_, columns_.begin + i));
    fit_terms();
    collect();
    return result();
  }

 private:
  Eigen::VectorXd solved(const Eigen::VectorXd& b) const {
    std::vector<double> x(b.data(), b.data() + b.size());
    equations_.solve_again(x);
    return Eigen::Map<const Eigen::VectorXd>(x.data(), b.size());
  }

  template <class Use>
  void for_each_corner(const Use& use) const {
    for (const RigView& view : problem_.views) {
      const RigFactors::View at = factors_.look(view.t_s);
      factors_.each_corner(
          at, *view.view,
          [&](const BoardCorner& corner, const Vec2& e, const CornerJacobian& J, const Mat23& by_corner) {
            use(SeenCorner{view.t_s, at, corner, corner.px - e, e, J, by_corner, corner_weight(e, problem_.noise)});
          });
    }
  }

  Eigen::Matrix<double, 2, kLensTerms> terms_at(const Vec2& px) const {
    return lens_terms(state_.constants.lens, px) * turned_;
  }

  /// The fit with the terms as further unknowns. They are turned so that their errors are independent of each other and
  /// 1, if those of the measurements are as their weights say.
  void fit_terms() {
    Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(size_, kLensTerms);  // J^T W (terms)
    TermMatrix information = TermMatrix::Zero();
    TermVector pull = TermVector::Zero();
    for_each_corner([&](const SeenCorner& c) {
      const Eigen::Matrix<double, 2, kLensTerms> terms = lens_terms(state_.constants.lens, c.px),
                                                 weighted_terms = c.weight * terms;
      const Eigen::MatrixXd by_view = c.J.transpose() * weighted_terms;
      for (std::size_t k = 0; k < 4; ++k) mixed.middleRows<6>(c.at.knot[k]) += c.at.weight[k] * by_view.topRows<6>();
      mixed.middleRows(columns_.begin, seen_) += by_view.bottomRows(seen_);
      mixed.middleRows<3>(factors_.column(c.corner)) += c.by_corner.transpose() * weighted_terms;
      information += terms.transpose() * weighted_terms;
      pull += weighted_terms.transpose() * c.e;
    });
    Eigen::MatrixXd moved(size_, kLensTerms);  // what the other unknowns do where a term grows
    for (int i = 0; i < kLensTerms; ++i) moved.col(i) = -solved(mixed.col(i));
    turned_.setZero();
    const Eigen::LLT<TermMatrix> root(information + mixed.transpose() * moved);
    // Else no corner is far enough from the centre.
    if (root.info() == Eigen::Success) turned_ = root.matrixU().solve(TermMatrix::Identity());
    by_terms_ = moved * turned_;
    terms_ = turned_.transpose() * pull;
    step_ = by_terms_ * terms_;
  }

  /// What a residual pulls at the constants, and, as it is with the terms, at these.
  Eigen::VectorXd pull_of(const FitResidual& r) const {
    Vec3 e_with_terms = r.e;
    for (std::size_t i = 0; i < r.count; ++i) {
      const FitResidual::Term& term = r.terms[i];
      e_with_terms += term.J.leftCols(term.width) * step_.segment(term.column, term.width);
    }
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(constants_ + kLensTerms);
    for (std::size_t i = 0; i < r.count; ++i) {
      const FitResidual::Term& term = r.terms[i];
      const auto J = -r.weight * term.J.leftCols(term.width).transpose();
      pull.head(constants_) += X_.middleRows(term.column, term.width).transpose() * (J * r.e);
      pull.tail<kLensTerms>() += by_terms_.middleRows(term.column, term.width).transpose() * (J * e_with_terms);
    }
    return pull;
  }

  /// The rows of X that a corner's pixel depends on: pose, constants, corner.
  Eigen::MatrixXd rows(const SeenCorner& c, const Eigen::MatrixXd& X) const {
    Eigen::MatrixXd at = Eigen::MatrixXd::Zero(6 + seen_ + 3, X.cols());
    for (std::size_t k = 0; k < 4; ++k) at.topRows<6>() += c.at.weight[k] * X.middleRows<6>(c.at.knot[k]);
    at.middleRows(6, seen_) = X.middleRows(columns_.begin, seen_);
    at.bottomRows<3>() = X.middleRows<3>(factors_.column(c.corner));
    return at;
  }

  Eigen::VectorXd pull_of(const SeenCorner& c) const {
    Eigen::MatrixXd J(2, 6 + seen_ + 3);
    J << c.J, c.by_corner;
    const Eigen::MatrixXd by_terms = J * rows(c, by_terms_) + terms_at(c.px);
    Eigen::VectorXd pull(constants_ + kLensTerms);
    pull << rows(c, X_).transpose() * (J.transpose() * (c.weight * c.e)),
        by_terms.transpose() * (c.weight * (c.e - by_terms * terms_));
    return pull;
  }

  void collect() {
    const auto add_at = [&](double t_s, const Eigen::VectorXd& pull) {
      for (TimeClusters& time : times_) time.clusters.add(static_cast<int>(std::floor(t_s / time.length_s)), pull);
    };
    for (const RigReading& reading : problem_.readings) {
      add_at(reading.t_s, pull_of(weighted(factors_.gyroscope(reading, 1), problem_.noise.gyroscope)) +
                              pull_of(weighted(factors_.accelerometer(reading, 1), problem_.noise.accelerometer)));
    }
    for_each_corner([&](const SeenCorner& c) {
      const Eigen::VectorXd pull = pull_of(c);
      add_at(c.t_s, pull);
      corners_.add(static_cast<int>(c.corner.id), pull);
      parts_.add(part_of_image(c.px, state_.constants.lens), pull);
    });
  }

  RigUncertainty result() const {
    const Eigen::MatrixXd white = X_.middleRows(columns_.begin, constants_);
    Eigen::VectorXd least = Eigen::VectorXd::Ones(constants_ + kLensTerms);
    least.head(constants_) = white.diagonal();
    Eigen::VectorXd most = least.cwiseMax(corners_.variances()).cwiseMax(parts_.variances());
    for (const TimeClusters& time : times_) most = most.cwiseMax(time.clusters.variances());
    const Eigen::VectorXd widened = (most.array() / least.array()).sqrt().head(constants_);
    RigUncertainty found{widened.asDiagonal() * white * widened.asDiagonal(), {}};
    for (int i = 0; i < kLensTerms; ++i) {
      if (std::abs(terms_[i]) < kNotByChance * std::sqrt(most[constants_ + i])) continue;
      Eigen::MatrixXd& misfit = found.misfit;
      misfit.conservativeResize(constants_ + kLensTerms, misfit.cols() + 1);
      misfit.rightCols<1>() << by_terms_.col(i).segment(columns_.begin, constants_), turned_.col(i);
      misfit.rightCols<1>() *= terms_[i];
    }
    return found;
  }

  const RigState& state_;
  const RigColumns& columns_;
  const FitEquations& equations_;
  const RigProblem& problem_;
  const RigFactors factors_;
  const Eigen::Index size_;
  const int constants_, seen_;  ///< how many; how many of them images see
  Eigen::MatrixXd X_;           ///< the constants' columns of the inverse
  TermMatrix turned_;           ///< lens_terms() by the turned ones
  TermVector terms_;            ///< their values, turned
  Eigen::MatrixXd by_terms_;    ///< how the other unknowns follow them
  Eigen::VectorXd step_;        ///< how far the other unknowns are from where they would be with the terms
  Clusters corners_{constants_ + kLensTerms}, parts_{constants_ + kLensTerms};
  std::vector<TimeClusters> times_;
};

}  // namespace

double RigUncertainty::sigma(int column) const {
  return std::sqrt(covariance(column, column) + (misfit.cols() ? misfit.row(column).squaredNorm() : 0));
}

FitResidual weighted(FitResidual r, double sigma) {
  r.weight = cauchy_weight(r.e.squaredNorm() / (3 * sigma * sigma)) / (sigma * sigma);
  return r;
}

double corner_weight(const Vec2& e_px, const RigNoise& noise) {
  const double variance = noise.corner_px * noise.corner_px;
  return cauchy_weight(e_px.squaredNorm() / variance) / variance;
}

RigUncertainty uncertainty_of(const RigState& state, const RigLayout& layout, const FitEquations& equations,
                              const RigProblem& problem) {
  return Uncertainty(state, layout, equations, problem).run();
}

}  // namespace epiline
