#include "estimator/solver/marginalise.h"

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

void Marginaliser::forget_pose(Window& w, int k) {
  Prior& p = w.prior;
  if (k >= p.frames) return;
  Matrix A = memory_->A;
  double* b = memory_->b;
  const int dim = p.dim();
  int where[kPriorDim];  // the pose first, the others in their order
  for (int i = 0; i < dim; ++i) where[i] = i < 6 * k ? i + 6 : i < 6 * k + 6 ? i - 6 * k : i;
  double d[kPriorDim];
  prior_difference(w, d);
  for (int i = 0; i < dim; ++i) {
    double g = p.b[i];
    for (int j = 0; j < dim; ++j) {
      g -= p.H[i][j] * d[j];
      if (where[j] >= where[i]) A[where[i]][where[j]] = p.H[i][j];
    }
    b[where[i]] = g;
  }
  elimination_.eliminate(A[0], b, 6, dim);
  --p.frames;
  store_prior(w, k, A, b, 6, p);
}

}  // namespace epiline
