#pragma once
// The reprojection problem written down directly: its depths explicit, its Jacobians numerical.
#include <Eigen/Dense>
#include <algorithm>
#include <vector>

#include "estimator/factors/reprojection.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {

/// A pinhole camera's centre and attitude when it took frame k.
struct Camera {
  Mat3 R;
  Vec3 c;
};
inline Camera camera(const Window& w, int k) {
  const Slot& s = w.at(k);
  const double dt = w.calibration.time_offset - s.time_offset_used;
  const Mat3 R = s.x.R * so3_exp((s.omega - s.x.b_g) * dt);
  return {R * w.calibration.R_BC, s.x.p + s.x.v * dt + R * w.calibration.p_BC};
}

/// Unknowns: poses 0..frames-1 (dp, then dphi in the world), calibration, one inverse distance a landmark.
class Explicit {
 public:
  /// `oldest_only`: the landmarks that frame 0 hosts.
  Explicit(Window& w, ReprojectionFactor& factor, int frames, bool oldest_only = false) : w_(w), frames_(frames) {
    for (int i = 0; i < w.track_count(); ++i) {
      std::vector<int> views;
      for (int k = 0; k < frames; ++k)
        if (w.seen(w.track(i), k)) views.push_back(k);
      if (views.size() < 2 || (oldest_only && views[0] != 0)) continue;
      tracks_.push_back(i);
      views_.push_back(views);
      rho.push_back(factor.landmark(i).inverse_distance);
    }
    const int total = states() + static_cast<int>(rho.size());
    H = Eigen::MatrixXd::Zero(total, total);
    b = Eigen::VectorXd::Zero(total);
    for (std::size_t i = 0; i < rho.size(); ++i)
      for (std::size_t v = 1; v < views_[i].size(); ++v) add(i, v);
  }

  int states() const { return 6 * frames_ + kCalibration; }
  int landmarks() const { return static_cast<int>(rho.size()); }
  int track(int i) const { return tracks_[static_cast<std::size_t>(i)]; }

  /// Without the depths.
  Eigen::MatrixXd reduced_H() const {
    const int n = states(), m = landmarks();
    return H.topLeftCorner(n, n) - H.topRightCorner(n, m) * depth_H().inverse() * H.bottomLeftCorner(m, n);
  }
  Eigen::VectorXd reduced_b() const {
    return b.head(states()) - H.topRightCorner(states(), landmarks()) * depth_H().inverse() * b.tail(landmarks());
  }

  Eigen::MatrixXd H;
  Eigen::VectorXd b;
  double cost = 0;
  std::vector<double> rho;

 private:
  Eigen::MatrixXd depth_H() const { return H.bottomRightCorner(landmarks(), landmarks()); }

  Vec2 residual(std::size_t i, std::size_t v) const {
    const TrackRecord& t = w_.track(tracks_[i]);
    const int h = views_[i][0], k = views_[i][v];
    const Camera host = camera(w_, h), other = camera(w_, k);
    const Vec3 X = host.c + host.R * w_.view(t, h).f_C / rho[i];
    const Vec3 X_C = other.R.transpose() * (X - other.c);
    const Observation& o = w_.view(t, k);
    return o.chart * X_C / o.f_C.dot(X_C) / 1.5;
  }

  void add(std::size_t i, std::size_t v) {
    constexpr double h = 1e-5;
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2, H.cols());
    auto difference = [&](int column, auto&& set) {
      Vec2 r[2];
      for (int side = 0; side < 2; ++side) r[side] = set(side ? -h : h);
      J.col(column) = (r[0] - r[1]) / (2 * h);
    };
    for (const int k : {views_[i][0], views_[i][v]})
      for (int c = 0; c < 6; ++c)
        difference(6 * k + c, [&](double d) {
          NavState& x = w_.at(k).x;
          const NavState keep = x;
          if (c < 3)
            x.p[c] += d;
          else
            x.R = so3_exp(d * Vec3::Unit(c - 3)) * x.R;
          const Vec2 r = residual(i, v);
          x = keep;
          return r;
        });
    for (int c = 0; c < kCalibration; ++c)
      difference(6 * frames_ + c, [&](double d) {
        const Calibration keep = w_.calibration;
        retract(w_.calibration, d * CalibrationTangent::Unit(c));
        const Vec2 r = residual(i, v);
        w_.calibration = keep;
        return r;
      });
    difference(states() + static_cast<int>(i), [&](double d) {
      const double keep = rho[i];
      rho[i] += d;
      const Vec2 r = residual(i, v);
      rho[i] = keep;
      return r;
    });
    const Vec2 r = residual(i, v);
    const double length = r.norm(), weight = length <= 1 ? 1 : 1 / length;
    cost += length <= 1 ? length * length : 2 * length - 1;
    H += weight * J.transpose() * J;
    b -= weight * J.transpose() * r;
  }

  Window& w_;
  int frames_;
  std::vector<int> tracks_;
  std::vector<std::vector<int>> views_;
};

inline Eigen::MatrixXd dense(const VisualSystem& v, int frames) {
  const int c = 6 * frames;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(c + kCalibration, c + kCalibration);
  for (int k = 0; k < frames; ++k) {
    for (int l = k; l < frames; ++l)
      H.block<6, 6>(6 * k, 6 * l) = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(v.H[k][l]);
    for (int j = 0; j < kCalibration; ++j) H.block<6, 1>(6 * k, c + j) = Eigen::Map<const Vec6>(v.H_ck[k] + 6 * j);
  }
  H.bottomRightCorner<kCalibration, kCalibration>() =
      Eigen::Map<const Eigen::Matrix<double, kCalibration, kCalibration, Eigen::RowMajor>>(v.H_cc);
  return H.selfadjointView<Eigen::Upper>();
}

inline Eigen::VectorXd dense_rhs(const VisualSystem& v, int frames) {
  Eigen::VectorXd b(6 * frames + kCalibration);
  for (int k = 0; k < frames; ++k) b.segment<6>(6 * k) = Eigen::Map<const Vec6>(v.b[k]);
  b.tail<kCalibration>() = Eigen::Map<const CalibrationTangent>(v.b_c);
  return b;
}

/// Largest difference of two matrices whose unknowns differ in unit, relative to the diagonal of the second.
inline double scaled_difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::VectorXd unit = b.diagonal().cwiseSqrt().cwiseInverse();
  return (unit.asDiagonal() * (a - b) * unit.asDiagonal()).cwiseAbs().maxCoeff();
}

}  // namespace epiline::test
