#include "estimator/factors/wheel.h"

#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {
using Mat6 = Eigen::Matrix<double, 6, 6>;

constexpr double kScaleWalk = 2e-3;  // per root of a second: tyres warm, loads and slopes change
constexpr double kSlipKernel = 2;    // sigmas: scale of the kernel against slip, as that of the tracks
constexpr double kSlip = 5;          // sigmas: a difference of two scales beyond is slip, not noise
constexpr double kLeastScale = 0.1;  // of wheels that read less, nothing is to be learned
constexpr double kRough_m = 1e-4;    // no way is known better, and a full turn on the spot knows none

Vec3 mean_axis(const Slot& s) { return s.imu.T > 0 ? Vec3(s.wheel.axis_s / s.imu.T) : Vec3(Vec3::Zero()); }
double sum(const WheelScale::Shares& share, const std::array<double, kMaxFrames>& of) {
  double s = 0;
  for (std::size_t i = 0; i < share.size(); ++i) s += share[i] * of[i];
  return s;
}

/// Variance of the way read along the axis.
double noise_of(const Window& w, const Slot& s) {
  return w.wheel.sigma_m_s * w.wheel.sigma_m_s * s.wheel.time_of_one_s2 * mean_axis(s).squaredNorm() +
         kRough_m * kRough_m;
}

void evaluate(const Window& w, int k, WheelResidual& out) {
  evaluate_wheel(w.wheel, w.at(k).wheel.way / w.at(k).wheel.scale, {w.at(k - 1).x, w.at(k).x}, out);
}

/// Cauchy's kernel of a squared residual in sigmas.
struct Kernel {
  double cost, weight;
  Kernel(double chi2, double scale) {
    const double s = chi2 / (scale * scale);
    cost = scale * scale * std::log1p(s);
    weight = 1 / (1 + s);
  }
};

/// Cost, half its gradient and curvature by the intervals' residuals along the way.
struct AlongSystem {
  double cost = 0;
  std::array<double, kMaxFrames> r{}, g{};
  std::array<std::array<double, kMaxFrames>, kMaxFrames> H{};

  /// Of the residual sum(share r) - `expected`.
  void add(const WheelScale::Shares& share, double expected, double variance) {
    const double off = sum(share, r) - expected;
    const Kernel kernel(off * off / variance, kSlipKernel);
    cost += kernel.cost;
    const double weight = kernel.weight / variance;
    for (std::size_t i = 0; i < share.size(); ++i) {
      if (share[i] == 0) continue;
      g[i] += weight * off * share[i];
      for (std::size_t j = 0; j < share.size(); ++j) H[i][j] += weight * share[i] * share[j];
    }
  }
};

/// Each way against the newer ones, and what all of the newest run say of its scale. That last term holds for one way
/// only, so it never becomes part of the prior.
void add_ways(const Window& w, const Share& share, AlongSystem& out) {
  WheelScale scale;
  bool newest_run = true;
  double found = 1;
  const auto end_run = [&] {
    const double sigma = w.wheel.scale_sigma / found;
    if (newest_run && !share.oldest_only) out.add(scale.share(), 1 - 1 / found, scale.variance() + sigma * sigma);
    newest_run = false;
  };
  for (int k = share.frames - 1; k >= 1; --k) {
    const Slot& s = w.at(k);
    if (!s.wheel.known) continue;
    if (s.wheel.slips) {
      end_run();
      scale.restart();
    }
    found = s.wheel.scale;
    const AlongWay along = along_way(w, k);
    out.r[static_cast<std::size_t>(k)] = along.moved - along.read / found;
    const WheelScale::Innovation innovation = scale.add(k, s.wheel.moved, noise_of(w, s) / (found * found));
    scale.walk(s.imu.T);
    if (!share.oldest_only || k == 1) out.add(innovation.share, 0, innovation.variance);
  }
  end_run();
}

void add_to(const Window& w, const AlongSystem& system, int frames, NormalEquations& out) {
  std::array<Vec6, kMaxFrames> begin, end;
  for (int k = 0; k < frames; ++k) {
    const auto i = static_cast<std::size_t>(k);
    begin[i].setZero();
    end[i].setZero();
    if (k == 0 || !w.at(k).wheel.known) continue;
    WheelResidual f;
    evaluate(w, k, f);
    const Vec3 axis = mean_axis(w.at(k));
    begin[i] = f.J_begin.transpose() * axis;
    end[i] = f.J_end.transpose() * axis;
  }
  // a frame ends one interval and begins the next
  for (int k = 0; k < frames; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const bool k_begins = k + 1 < frames;
    Vec6 b = system.g[i] * end[i];
    if (k_begins) b += system.g[i + 1] * begin[i + 1];
    out.add(pose_of(k), Vec6(-b));
    for (int l = 0; l <= k; ++l) {
      const auto j = static_cast<std::size_t>(l);
      const bool l_begins = l + 1 < frames;
      Vec6 by_end = system.H[i][j] * end[j];
      if (l_begins) by_end += system.H[i][j + 1] * begin[j + 1];
      Mat6 H = end[i] * by_end.transpose();
      if (k_begins) {
        Vec6 by_begin = system.H[i + 1][j] * end[j];
        if (l_begins) by_begin += system.H[i + 1][j + 1] * begin[j + 1];
        H += begin[i + 1] * by_begin.transpose();
      }
      out.add(pose_of(k), pose_of(l), H);
    }
  }
}

/// The vehicle goes neither sideways nor up. The error does not average out within an interval.
double add_sideways(const Window& w, int k, NormalEquations* out) {
  WheelResidual f;
  evaluate(w, k, f);
  const double sigma_m = w.wheel.sideways_sigma_m_s * w.at(k).imu.T;
  const Vec3 axis = mean_axis(w.at(k));
  const Mat3 information = (axis.squaredNorm() * Mat3::Identity() - axis * axis.transpose()) / (sigma_m * sigma_m);
  const Kernel kernel(f.r.dot(information * f.r), kSlipKernel);
  if (!out) return kernel.cost;
  const Mat3 weighted = kernel.weight * information;
  out->add(pose_of(k - 1), Vec6(-f.J_begin.transpose() * weighted * f.r));
  out->add(pose_of(k), Vec6(-f.J_end.transpose() * weighted * f.r));
  out->add(pose_of(k - 1), pose_of(k - 1), Mat6(f.J_begin.transpose() * weighted * f.J_begin));
  out->add(pose_of(k - 1), pose_of(k), Mat6(f.J_begin.transpose() * weighted * f.J_end));
  out->add(pose_of(k), pose_of(k), Mat6(f.J_end.transpose() * weighted * f.J_end));
  return kernel.cost;
}

}  // namespace

void evaluate_wheel(const WheelModel& wheel, const Vec3& way, const std::array<NavState, 2>& x, WheelResidual& out) {
  const Vec3& p = wheel.p_BV;
  const Mat3 R_T = x[0].R.transpose();
  const Vec3 moved = R_T * (x[1].p + x[1].R * p - x[0].p);
  out.r = moved - p - way;
  out.J_begin << -R_T, skew(moved);
  out.J_end << R_T, -R_T * x[1].R * skew(p);
}

AlongWay along_way(const Window& w, int k) {
  const Slot& s = w.at(k);
  WheelResidual f;
  evaluate(w, k, f);
  const Vec3 axis = mean_axis(s);
  const double read = axis.dot(s.wheel.way);
  return {axis.dot(f.r) + read / s.wheel.scale, read};
}

WheelScale::Innovation WheelScale::add(int k, double moved, double noise) noexcept {
  Innovation innovation{moved * moved * variance_ + noise, {}};
  for (std::size_t i = 0; i < share_.size(); ++i) innovation.share[i] = -moved * share_[i];
  innovation.share[static_cast<std::size_t>(k)] += 1;
  const double gain = variance_ * moved / innovation.variance;
  for (std::size_t i = 0; i < share_.size(); ++i) share_[i] += gain * innovation.share[i];
  variance_ *= noise / innovation.variance;
  return innovation;
}

void WheelScale::walk(double dt_s) noexcept { variance_ += kScaleWalk * kScaleWalk * dt_s; }

void find_slips(Window& w) {
  WheelScale scale;
  WheelScale::Shares off{};
  int end = w.size();
  const auto end_run = [&](int begin) {
    const double found = 1 - sum(scale.share(), off);
    for (int k = begin; k < end; ++k)
      w.at(k).wheel.scale = std::copysign(std::max(std::abs(found), kLeastScale), found);
    end = begin;
    scale.restart();
  };
  for (int k = w.size() - 1; k >= 1; --k) {
    Slot& s = w.at(k);
    if (!s.wheel.known) continue;
    const AlongWay along = along_way(w, k);
    s.wheel.moved = along.moved;
    off[static_cast<std::size_t>(k)] = along.moved - along.read;
    const double noise = noise_of(w, s);
    WheelScale with = scale;
    const WheelScale::Innovation innovation = with.add(k, along.moved, noise);
    const double r = sum(innovation.share, off);
    s.wheel.slips = r * r > kSlip * kSlip * innovation.variance;
    if (s.wheel.slips) {
      end_run(k + 1);
      scale.add(k, along.moved, noise);
    } else {
      scale = with;
    }
    scale.walk(s.imu.T);
  }
  end_run(1);
}

double add_wheel(const Window& w, const Share& share, NormalEquations* out) {
  bool any = false;
  for (int k = 1; k < share.frames; ++k) any = any || w.at(k).wheel.known;
  if (!any) return 0;
  AlongSystem system;
  add_ways(w, share, system);
  if (out) add_to(w, system, share.frames, *out);
  double cost = system.cost;
  const int end = share.oldest_only ? 2 : share.frames;
  for (int k = 1; k < end && w.wheel.sideways_sigma_m_s > 0; ++k)
    if (w.at(k).wheel.known) cost += add_sideways(w, k, out);
  return cost;
}

}  // namespace epiline
