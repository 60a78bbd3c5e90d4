#include "estimator/solver/marginalise.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "estimator/factors/factors.h"
#include "estimator/factors/prior.h"

namespace epiline {

// Unknowns: pose and (v, b) of frame 0, which go; then poses 1..m-1, (v, b) of frame 1 and the calibration, which stay.
struct Marginaliser::Memory {
  VisualSystem visual;
  alignas(64) double A[kMarginalDim][kMarginalStride];
  double b[kMarginalDim];
};

Marginaliser::Marginaliser(InstructionSet set)
    : factors_(factor_kernels(set)), elimination_(elimination_kernels(set)), memory_(new Memory) {}
Marginaliser::~Marginaliser() = default;

namespace {

/// Where a frame's unknowns stand when the frames 0..m-1 take part.
struct Layout {
  int m;
  int pose(int k) const { return k == 0 ? 0 : 15 + 6 * (k - 1); }
  int velocity(int k) const { return k == 0 ? 6 : 15 + 6 * (m - 1); }  // frames 0 and 1 only
  int calibration() const { return velocity(1) + 9; }
  int total() const { return calibration() + kCalibration; }
};

using Matrix = double (*)[kMarginalStride];

class MarginalEquations final : public NormalEquations {
 public:
  MarginalEquations(const Layout& at, Matrix A, double* b) : at_(at), A_(A), b_(b) {}
  Block block(Unknown a, Unknown b) noexcept override {
    const int i = row(a), j = row(b);
    return i <= j ? Block{&A_[i][j], kMarginalStride, 1} : Block{&A_[j][i], 1, kMarginalStride};
  }
  double* rhs(Unknown a) noexcept override { return b_ + row(a); }

 private:
  int row(Unknown a) const {
    if (a.kind == Unknown::Kind::kCamera) return at_.calibration();
    if (a.kind == Unknown::Kind::kScales) return at_.calibration() + kCameraCalibration;
    return a.kind == Unknown::Kind::kPose ? at_.pose(a.frame) : at_.velocity(a.frame);
  }

  Layout at_;
  Matrix A_;
  double* b_;
};

/// Upper triangle, in whole vectors.
void clear(Matrix A, double* b, int total) {
  const int end = (total + kBatchLanes - 1) / kBatchLanes * kBatchLanes;
  for (int i = 0; i < total; ++i) {
    const int begin = i / kBatchLanes * kBatchLanes;
    std::memset(A[i] + begin, 0, sizeof A[i][0] * static_cast<std::size_t>(end - begin));
  }
  std::memset(b, 0, sizeof b[0] * static_cast<std::size_t>(total));
}

/// What is left of the equations after the first `gone` unknowns, at the window's present states but that of frame k.
void store_prior(const Window& w, int k, const Matrix A, const double* b, int gone, Prior& p) {
  for (int i = 0; i < p.dim(); ++i) {
    p.b[i] = b[gone + i];
    for (int j = i; j < p.dim(); ++j) p.H[i][j] = p.H[j][i] = A[gone + i][gone + j];
  }
  for (int l = 0; l < p.frames; ++l) p.x0[l] = w.at(l < k ? l : l + 1).x;
  p.c0 = w.calibration;
}

}  // namespace

void Marginaliser::marginalise_oldest(Window& w, VisualFactorModel& visual, const VisualSettings& settings) {
  const Layout at{visual.prior_reaches_newest() ? w.size() : w.lasting()};
  Matrix A = memory_->A;
  double* b = memory_->b;
  clear(A, b, at.total());
  visual.marginalise_oldest(w, settings, memory_->visual);
  MarginalEquations equations(at, A, b);
  add_factors(w, memory_->visual, {at.m, true}, factors_, equations);
  elimination_.eliminate(A[0], b, 15, at.total());
  w.prior.frames = at.m - 1;
  store_prior(w, 0, A, b, 15, w.prior);
  for (int k = 1; k < w.size(); ++k)
    if (w.at(k).rest_link == w.at(0).id) w.at(k).rest_link = 0;
  w.remove(0);
}

/// The prior's equations where the window is now, its numbers in that order; upper triangle.
void Marginaliser::load_prior(const Window& w, const int* order) {
  const Prior& p = w.prior;
  double d[kPriorDim];
  prior_difference(w, d);
  for (int i = 0; i < p.dim(); ++i) {
    const double* H = p.H[order[i]];
    double g = p.b[order[i]];
    for (int j = 0; j < p.dim(); ++j) g -= H[j] * d[j];
    for (int j = i; j < p.dim(); ++j) memory_->A[i][j] = H[order[j]];
    memory_->b[i] = g;
  }
}

void Marginaliser::forget_pose(Window& w, int k) {
  Prior& p = w.prior;
  if (k >= p.frames) return;
  const int dim = p.dim();
  int order[kPriorDim];  // the pose first, the others behind it
  for (int i = 0; i < dim; ++i) order[i] = i < 6 ? 6 * k + i : i < 6 * k + 6 ? i - 6 : i;
  load_prior(w, order);
  elimination_.eliminate(memory_->A[0], memory_->b, 6, dim);
  --p.frames;
  store_prior(w, k, memory_->A, memory_->b, 6, p);
}

namespace {
constexpr int kMayStep = 4;  // the gyroscope's bias, the time offset
using StepCovariance = Eigen::Matrix<double, kMayStep, kMayStep>;
using Steps = Eigen::Matrix<double, kMayStep, 1>;

/// Adds the most likely variance of a step of numbers that are seen to be `by` off, whose squared sigmas sum to `chi2`.
template <int n>
bool forget(Prior& p, int row, const Eigen::Matrix<double, n, 1>& by, double chi2) {
  if (!(chi2 > n)) return false;
  const Eigen::Matrix<double, n, 1> stepped = std::sqrt(1. / n - 1 / chi2) * by;
  inflate(p, row, {stepped.data(), n});
  return true;
}
}  // namespace

bool Marginaliser::let_step(Window& w, const SolverSettings& settings) {
  Prior& p = w.prior;
  if (p.frames < 2) return false;  // not learned but assumed, by a start
  const int n = p.dim(), c = p.calibration_row(), b_g = c - 3, time_offset = c + kTimeOffsetColumn, last = n - kMayStep;
  int order[kPriorDim], others = 0;  // what may step comes last
  for (int i = 0; i < n; ++i)
    if ((i < b_g || i >= c) && i != time_offset) order[others++] = i;
  for (int i = 0; i < 3; ++i) order[last + i] = b_g + i;
  order[n - 1] = time_offset;
  Matrix A = memory_->A;
  double* g = memory_->b;
  load_prior(w, order);
  for (int i = 0; i < n; ++i)
    if (order[i] >= c && !settings.estimates(order[i] - c)) {  // stands still
      for (int j = 0; j < n; ++j) A[std::min(i, j)][std::max(i, j)] = i == j;
      g[i] = 0;
    }
  // With the gradient as one more column, what elimination leaves in the corner is minus chi^2 of what is eliminated.
  for (int i = 0; i < n; ++i) A[i][n] = g[i];
  A[n][n] = g[n] = 0;
  elimination_.eliminate(A[0], g, last, n + 1);
  StepCovariance H;
  Steps left;
  for (int i = 0; i < kMayStep; ++i) {
    for (int j = 0; j < kMayStep; ++j) H(i, j) = A[last + std::min(i, j)][last + std::max(i, j)];
    left[i] = A[last + i][n];
  }
  const Eigen::LLT<StepCovariance> llt(H);
  if (llt.info() != Eigen::Success) return false;
  const StepCovariance P = llt.solve(StepCovariance::Identity());
  const Steps off = P * left;
  const Vec3 bias = off.head<3>();
  const double of_all = left.dot(off) - A[n][n], of_bias = bias.dot(P.topLeftCorner<3, 3>().llt().solve(bias)),
               of_offset = off[3] * off[3] / P(3, 3);
  forget<3>(p, b_g, bias, of_bias);
  return of_all > n && forget<1>(p, time_offset, off.tail<1>(), of_offset);  // it does not drift
}

}  // namespace epiline
