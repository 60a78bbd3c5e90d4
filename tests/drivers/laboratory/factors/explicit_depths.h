#pragma once
// The reprojection problem written down directly: its depths explicit, its Jacobians numerical.
#include <Eigen/Core>
#include <vector>

#include "drivers/laboratory/factors/reprojection.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/factors/explicit_residuals.h"

namespace epiline::test {

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

  int states() const { return 6 * frames_ + kCameraCalibration; }
  int landmarks() const { return static_cast<int>(rho.size()); }
  int track(int i) const { return tracks_[static_cast<std::size_t>(i)]; }

  /// Without the depths.
  Eigen::MatrixXd reduced_H() const {
    const int n = states(), m = landmarks();
    return H.topLeftCorner(n, n) - congruence(inverse(depth_H()), H.bottomLeftCorner(m, n));
  }
  Eigen::VectorXd reduced_b() const {
    return b.head(states()) - product(H.topRightCorner(states(), landmarks()), solve(depth_H(), b.tail(landmarks())));
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
    const Vec3 X = host.c + host.R * bearing_of(w_.view(t, h)) / rho[i];
    const Vec3 X_C = other.R.transpose() * (X - other.c);
    const Observation& o = w_.view(t, k);
    return chart_of(o) * X_C / bearing_of(o).dot(X_C) / 1.5;
  }

  void add(std::size_t i, std::size_t v) {
    const auto at_present = [&] { return residual(i, v); };
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2, H.cols());
    J.leftCols(states()) = slopes(w_, 2, frames_, {views_[i][0], views_[i][v]}, at_present);
    J.col(states() + static_cast<int>(i)) = central_difference([&](double d) -> Eigen::VectorXd {
      const double keep = rho[i];
      rho[i] += d;
      const Vec2 r = residual(i, v);
      rho[i] = keep;
      return r;
    });
    add_huber(J, residual(i, v), H, b, cost);
  }

  Window& w_;
  int frames_;
  std::vector<int> tracks_;
  std::vector<std::vector<int>> views_;
};

}  // namespace epiline::test
