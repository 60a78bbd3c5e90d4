#pragma once
// A track's residuals written down directly, their covariance in full, their slopes numerical.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator/factors/visual.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/factors/explicit_residuals.h"

namespace epiline::test {

/// One track that the first camera sees in every frame: 2 numbers a view in px, the first camera's before the second
/// one's. The axes are turned until they agree best: the first camera's from view to view, the second one's with the
/// first one's.
class ExplicitTrack {
 public:
  ExplicitTrack(Window& window, const TrackRecord& track) : w_(window), t_(track) {
    std::vector<Mat23> axes;
    for (int k = 0; k < w_.size(); ++k) {
      add(w_.view(t_, k), k, false, axes.empty() ? Mat23::Zero() : axes.back());
      axes.push_back(views_.back().chart * camera(views_.back()).R.transpose());
    }
    for (int k = 0; k < w_.size(); ++k)
      if (w_.seen_by_second(t_, k)) add(w_.second_view(t_, k), k, true, axes[static_cast<std::size_t>(k)]);
  }
  int views() const { return static_cast<int>(views_.size()); }

  /// The track's part of the normal equations (poses, then calibration) and of the cost, its point eliminated.
  struct Equations {
    Eigen::MatrixXd H;
    Eigen::VectorXd b;
    double cost = 0;
  };
  Equations equations(const VisualSettings& s) {
    const bool drifts = s.noise == TrackNoiseModel::kDrift;
    const double sigma = drifts ? s.drift_sigma * s.drift_inflation : s.pixel_sigma * s.sigma_inflation;
    const double unit = drifts ? s.drift_inflation * s.drift_inflation : 1;
    Eigen::MatrixXd C = Eigen::MatrixXd::Identity(2 * views(), 2 * views());
    if (drifts) set_drift(C);
    const Eigen::MatrixXd I = inverse(sigma * sigma * C);
    const Camera first = test::camera(w_, 0);
    Vec3 P = first.c + 4 * first.R * bearing_of(w_.view(t_, 0));
    for (int i = 0; i < 100; ++i) {
      const Eigen::MatrixXd K = slopes_by_point(P);
      P -= solve(congruence(I, K), product(K.transpose(), product(I, residuals(P))));
    }
    const Eigen::MatrixXd K = slopes_by_point(P);
    const Eigen::VectorXd r = residuals(P);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(r.size(), 6 * w_.size() + kCameraCalibration);
    for (int i = 0; i < views(); ++i) {
      const View& v = views_[static_cast<std::size_t>(i)];
      J.middleRows(2 * i, 2) = slopes(w_, 2, w_.size(), {v.frame}, [&] { return residual(v, P); });
    }
    const Eigen::MatrixXd rest = I - congruence(inverse(congruence(I, K)), product(K.transpose(), I));
    const double dof = 2 * views() - 3, chi2 = r.dot(product(I, r).col(0));
    const double weight = (s.student + dof) / (s.student + chi2 * unit);
    return {weight * congruence(rest, J), -weight * product(J.transpose(), product(rest, r)),
            (s.student + dof) / unit * std::log1p(chi2 * unit / s.student)};
  }

 private:
  struct View {
    int frame;
    bool second;
    Vec3 f;
    Mat23 chart;  ///< by directions in W
  };

  Camera camera(const View& v) const {
    Camera c = test::camera(w_, v.frame);
    if (v.second) c = {c.R * w_.rig.poses[1].R_CD, c.c + c.R * w_.rig.poses[1].p_CD};
    return c;
  }
  void add(const Observation& o, int frame, bool second, const Mat23& axes) {
    View v{frame, second, bearing_of(o), chart_of(o)};
    const Eigen::Matrix2d product = chart_of(o) * camera(v).R.transpose() * axes.transpose();
    const double c = product(0, 0) + product(1, 1), s = product(0, 1) - product(1, 0), n = std::hypot(c, s);
    if (n > 0) v.chart = (Eigen::Matrix2d() << c / n, -s / n, s / n, c / n).finished() * v.chart;
    views_.push_back(v);
  }
  Eigen::VectorXd residual(const View& v, const Vec3& P) const {
    const Camera c = camera(v);
    Vec3 X = c.R.transpose() * (P - c.c);
    if (!v.second) X.z() *= 1 - w_.calibration.focal - w_.calibration.shape * (1 - X.normalized().z()) / 0.15;
    return -v.chart * X / v.f.dot(X);
  }
  Eigen::VectorXd residuals(const Vec3& P) const {
    Eigen::VectorXd r(2 * views());
    for (int i = 0; i < views(); ++i) r.segment<2>(2 * i) = residual(views_[static_cast<std::size_t>(i)], P);
    return r;
  }
  Eigen::MatrixXd slopes_by_point(const Vec3& P) const {
    constexpr double h = 1e-5;
    Eigen::MatrixXd K(2 * views(), 3);
    for (int c = 0; c < 3; ++c)
      K.col(c) = (residuals(P + h * Vec3::Unit(c)) - residuals(P - h * Vec3::Unit(c))) / (2 * h);
    return K;
  }
  /// The first camera's error e is a random walk from the track's first image on, and one step more. The second one's
  /// is share * e, and a walk of its own since the track was found there.
  void set_drift(Eigen::MatrixXd& C) const {
    const double found = w_.second_view(t_, w_.size() - 1).found;
    const double share = (found + 1 + 0.65 * 10) / (found + 1 + 10);
    const double start = 7 + (1 - share) * (1 - share) * (found + 1), step = 1 - 2 * 0.65 * share + share * share;
    for (int i = 0; i < views(); ++i)
      for (int j = 0; j < views(); ++j) {
        const View &a = views_[static_cast<std::size_t>(i)], &b = views_[static_cast<std::size_t>(j)];
        const double age = w_.view(t_, std::min(a.frame, b.frame)).age;
        double both = (a.second ? share : 1) * (b.second ? share : 1) * (1 + age);
        if (a.second && b.second) both += start + step * (age - found);
        for (const int axis : {0, 1}) C(2 * i + axis, 2 * j + axis) = both;
      }
  }

  Window& w_;
  const TrackRecord& t_;
  std::vector<View> views_;
};

}  // namespace epiline::test
