#include "estimator/initialise/start_point.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace epiline {
namespace {

using Mat6 = Eigen::Matrix<double, 6, 6>;

constexpr int kFirstSteps = 2;           // of a point from its closed form; from where it was last, one is enough
constexpr double kMedianLength = 1.177;  // of two unit Gaussians
constexpr int kBiases = 5;               // first column of (b_g, b_a)

void put_rows(const Mat3& M, double* out) { Eigen::Map<RowMat3>{out} = M; }
void put_vector(const Vec3& v, double* out) { Eigen::Map<Vec3>{out} = v; }

template <std::size_t N>
double median(std::array<double, N>& v, int n) {
  std::nth_element(v.begin(), v.begin() + n / 2, v.begin() + n);
  return v[static_cast<std::size_t>(n / 2)];
}

}  // namespace

void place_cameras(const StartProblem& problem, const StartPath& path, const StartState& state, StartCameras& camera) {
  for (int k = 0; k < problem.frames; ++k) {
    StartCamera& c = camera[k];
    const StartFrame& f = path[k];
    const Vec3 p = f.position(state);
    put_rows(f.R * problem.R_BC, c.R);
    put_vector(p + f.R * problem.p_BC, c.c);
    put_vector(p, c.p);
    c.T = f.T;
    c.half_T2 = 0.5 * f.T * f.T;
    put_rows(f.alpha_b.leftCols<3>(), c.p_b_g);
    put_rows(f.alpha_b.rightCols<3>(), c.p_b_a);
    put_rows(f.rotation_rows(), c.turn_b_g);
  }
}

double mean_score(const StartEquations& equations, int frames) {
  double total = 0;
  for (int k = 0; k < frames; ++k) {
    Mat6 H = Eigen::Map<const Mat6>(equations.H_pose[k]);
    H.diagonal().array() += 1e-6;
    const Eigen::Map<const Vec6> b(equations.b_pose[k]);
    total += b.dot(H.llt().solve(b)) / 6;
  }
  return total / frames;
}

/// J' H J and J' b with J = [T I, T^2/2 G, P; 0, 0, S] of each frame, P and S being its derivatives by the biases: the
/// frames' sums come first, and G, which they share, last.
void add(const StartEquations& equations, const StartCameras& camera, int frames, const GravityTurns& gravity,
         StartNormal& sum) {
  using Mat36 = Eigen::Matrix<double, 3, 6>;
  Mat3 vv = Mat3::Zero(), vg = Mat3::Zero(), gg = Mat3::Zero();
  Mat36 v_bias = Mat36::Zero(), g_bias = Mat36::Zero();
  Mat6 bias = Mat6::Zero();
  Vec3 v = Vec3::Zero(), g = Vec3::Zero();
  Vec6 b = Vec6::Zero();
  for (int k = 0; k < frames; ++k) {
    const StartCamera& c = camera[k];
    const Eigen::Map<const Mat6> H(equations.H_pose[k]);
    const Eigen::Map<const Vec6> b_pose(equations.b_pose[k]);
    Mat36 P;
    P << Eigen::Map<const RowMat3>(c.p_b_g), Eigen::Map<const RowMat3>(c.p_b_a);
    const Mat3 S = Eigen::Map<const RowMat3>(c.turn_b_g);
    const Mat3 pp = H.topLeftCorner<3, 3>(), p_turn = H.topRightCorner<3, 3>() * S;
    Mat36 by_p = pp * P;
    by_p.leftCols<3>() += p_turn;
    vv += (c.T * c.T) * pp;
    vg += (c.T * c.half_T2) * pp;
    gg += (c.half_T2 * c.half_T2) * pp;
    v_bias += c.T * by_p;
    g_bias += c.half_T2 * by_p;
    bias += P.transpose() * by_p;
    bias.topRows<3>() += p_turn.transpose() * P;
    bias.topLeftCorner<3, 3>() += S.transpose() * H.bottomRightCorner<3, 3>() * S;
    v += c.T * b_pose.head<3>();
    g += c.half_T2 * b_pose.head<3>();
    b += P.transpose() * b_pose.head<3>();
    b.head<3>() += S.transpose() * b_pose.tail<3>();
  }
  sum.H += Eigen::Map<const StartMatrix>(equations.H[0]);  // symmetric: its rows stand for columns
  sum.H.topLeftCorner<3, 3>() += vv;
  sum.H.block<3, 2>(0, 3) += vg * gravity;
  sum.H.block<2, 2>(3, 3) += gravity.transpose() * gg * gravity;
  sum.H.topRightCorner<3, 6>() += v_bias;
  sum.H.block<2, 6>(3, kBiases) += gravity.transpose() * g_bias;
  sum.H.bottomRightCorner<6, 6>() += bias;
  sum.b += Eigen::Map<const StartVector>(equations.b);
  sum.b.head<3>() += v;
  sum.b.segment<2>(3) += gravity.transpose() * g;
  sum.b.tail<6>() += b;
  sum.cost += equations.cost;
}

void PointElimination::put(const StartTrack& track, int batch, int lane) {
  StartBatch& to = batch_[batch];
  to.first = std::min<int>(to.first, track.frame[0]);
  to.last = std::max<int>(to.last, track.frame[track.count - 1]);
  for (int q = 0; q < track.count; ++q) {
    const int k = track.frame[q];
    for (int i = 0; i < 3; ++i) to.f[k][i][lane] = track.f_C[q][i];
    seen_[batch][lane] |= 1u << k;
  }
}

/// Sorted by the frames that they span, so that a batch spans few more frames than its tracks do.
void PointElimination::collect(const StartProblem& problem) {
  const int tracks = std::min<int>(kStartTracks, static_cast<int>(problem.tracks.size()));
  const auto track = [&](int t) -> const StartTrack& { return problem.tracks[static_cast<std::size_t>(t)]; };
  const auto before = [&](int a, int b) {
    const auto key = [&](int t) {
      return (track(t).frame[0] * kStartFrames + track(t).frame[track(t).count - 1]) * kStartTracks + t;
    };
    return key(a) < key(b);
  };
  frames_ = problem.frames;
  batches_ = 0;
  std::array<std::uint16_t, kStartTracks> order;
  for (const bool third : {true, false}) {
    int n = 0;
    for (int t = 0; t < tracks; ++t)
      if ((t % 3 == 0) == third && track(t).count >= 2) order[n++] = static_cast<std::uint16_t>(t);
    std::sort(order.begin(), order.begin() + n, before);
    for (int i = 0; i < n; ++i) {
      if (i % kBatchLanes == 0) {
        std::memset(batch_[batches_].f, 0, sizeof batch_[0].f[0] * static_cast<std::size_t>(frames_));
        batch_[batches_].first = kStartFrames;
        batch_[batches_].last = 0;
        seen_[batches_].fill(0);
        ++batches_;
      }
      put(track(order[i]), batches_ - 1, i % kBatchLanes);
    }
    if (third) thirds_ = batches_;
  }
  forget_points();
}

void PointElimination::forget_points() {
  known_ = false;
  for (int n = 0; n < batches_; ++n) std::memset(&point_[accepted_][n], 0, sizeof point_[0][0]);
}

void PointElimination::eliminate(const StartCameras& camera, const GravityTurns& gravity, double sigma, double kernel,
                                 Share share, StartEquations& out) {
  const Eigen::Matrix<double, 3, 2, Eigen::RowMajor> turns = gravity;
  kernels_.eliminate(batch_.data(), batches(share), camera.data(), frames_, turns.data(),
                     {sigma * sigma, kernel * kernel, known_ ? 1 : kFirstSteps}, point_[accepted_].data(),
                     point_[1 - accepted_].data(), scratch_, out);
}

void PointElimination::accept() {
  known_ = true;
  accepted_ = 1 - accepted_;
}

int PointElimination::views(int batch, int lane) const { return std::popcount(seen_[batch][lane]); }

int PointElimination::freedom(Share share) const {
  int freedom = -kStartDof;
  for (int n = 0; n < batches(share); ++n)
    for (int lane = 0; lane < kBatchLanes; ++lane)
      if (views(n, lane) > 0) freedom += 2 * views(n, lane) - 3;
  return freedom;
}

double PointElimination::typical_residual(const StartCameras& camera, double sigma, double kernel, int& tracks) const {
  std::array<double, kStartTracks> length;
  tracks = 0;
  for (int n = 0; n < batches_; ++n) {
    alignas(64) double residual2[kStartFrames][kBatchLanes];
    kernels_.residuals(&batch_[n], 1, camera.data(), {sigma * sigma, kernel * kernel, 1}, &point_[accepted_][n],
                       &residual2);
    for (int lane = 0; lane < kBatchLanes; ++lane) {
      const int count = views(n, lane);
      if (count < 3) continue;
      std::array<double, kStartFrames> s;
      int q = 0;
      for (std::uint32_t mask = seen_[n][lane]; mask != 0; mask &= mask - 1)
        s[q++] = residual2[std::countr_zero(mask)][lane];
      // 2 n - 3 of 2 n degrees of freedom are left after the point is fitted
      length[tracks++] = std::sqrt(median(s, count) * (2.0 * count) / (2.0 * count - 3));
    }
  }
  return tracks == 0 ? 0 : median(length, tracks) / kMedianLength;
}

double PointElimination::parallax(const StartCameras& camera) const {
  std::array<double, kStartTracks> all;
  int tracks = 0;
  for (int n = 0; n < batches_; ++n) {
    alignas(64) double sine2[kBatchLanes];
    kernels_.widest(&batch_[n], 1, camera.data(), &sine2);
    for (int lane = 0; lane < kBatchLanes; ++lane)
      if (views(n, lane) >= 3) all[tracks++] = sine2[lane];
  }
  return tracks == 0 ? 0 : std::asin(std::sqrt(std::min(1.0, median(all, tracks))));
}

StartLinear PointElimination::linear(const StartCameras& camera, double least, double sigma,
                                     const double (*at)[3]) const {
  StartLinear system;
  kernels_.see_linear(batch_.data(), batches_, camera.data(), least, sigma, at, system);
  return system;
}

}  // namespace epiline
