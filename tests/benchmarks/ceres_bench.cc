// The same window of landmarks in Ceres, as VINS-Mono sets it up (DENSE_SCHUR, DOGLEG, at most eight iterations, one
// thread, Huber(1), 1.5 px, analytic derivatives) and in ours: first that both mean the same problem, then the time of
// each. The cost functions are written here from docs/derivations/reprojection.md and imu.md; of our code they share
// the preintegrated readings and the synthetic window.
#include <benchmark/benchmark.h>
#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "estimator/factors/prior.h"
#include "estimator/factors/reprojection.h"
#include "estimator/factors/track.h"
#include "estimator/solver/marginalise.h"
#include "estimator/solver/solver.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::VectorXd;
template <int rows, int columns>
using RowMajor = Eigen::Matrix<double, rows, columns, Eigen::RowMajor>;

constexpr int kIterations = 8;
constexpr SolverSettings kSettings{.steps = kIterations, .estimate_time_offset = false, .estimate_extrinsics = false};

Mat3 hat(const Vec3& a) {
  Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}
Quaterniond exp_of(const Vec3& a) {
  const double angle = a.norm();
  if (angle < 1e-12) return Quaterniond(1, 0.5 * a.x(), 0.5 * a.y(), 0.5 * a.z()).normalized();
  return Quaterniond(Eigen::AngleAxisd(angle, a / angle));
}
Vec3 log_of(const Quaterniond& q) {
  const Eigen::AngleAxisd a(q);
  return (a.angle() > M_PI ? a.angle() - 2 * M_PI : a.angle()) * a.axis();
}
Mat3 inverse_right_jacobian(const Vec3& a) {
  const double t2 = a.squaredNorm(), t = std::sqrt(t2);
  const double c = t < 1e-4 ? 1.0 / 12 + t2 / 720 : 1 / t2 - (1 + std::cos(t)) / (2 * t * std::sin(t));
  return Mat3::Identity() + 0.5 * hat(a) + c * hat(a) * hat(a);
}

/// (p, q), q in Eigen's order; tangent (dp, dtheta), rotation on the right. Jacobians of residuals are by the tangent
/// already, in the first six columns.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* d, double* out) const override {
    Eigen::Map<Vec3>{out} = Eigen::Map<const Vec3>(x) + Eigen::Map<const Vec3>(d);
    Eigen::Map<Quaterniond>(out + 3) =
        (Eigen::Map<const Quaterniond>(x + 3) * exp_of(Eigen::Map<const Vec3>(d + 3))).normalized();
    return true;
  }
  bool PlusJacobian(const double*, double* J) const override {
    Eigen::Map<RowMajor<7, 6>> m(J);
    m.setZero();
    m.topRows<6>().setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* d) const override {
    Eigen::Map<Vec3>(d) << Eigen::Map<const Vec3>(y) - Eigen::Map<const Vec3>(x);
    Eigen::Map<Vec3>(d + 3) =
        log_of(Eigen::Map<const Quaterniond>(x + 3).conjugate() * Eigen::Map<const Quaterniond>(y + 3));
    return true;
  }
  bool MinusJacobian(const double*, double* J) const override {
    Eigen::Map<RowMajor<6, 7>> m(J);
    m.setZero();
    m.leftCols<6>().setIdentity();
    return true;
  }
};

struct Pose {
  Vec3 p;
  Mat3 R;
  explicit Pose(const double* x) : p(x), R(Eigen::Map<const Quaterniond>(x + 3).toRotationMatrix()) {}
};

/// Blocks: host's pose, other pose, extrinsics (held), inverse distance.
class Projection final : public ceres::SizedCostFunction<2, 7, 7, 7, 1> {
 public:
  Projection(const Observation& host, const Observation& seen)
      : host_(bearing_of(host)), f_C_(bearing_of(seen)), chart_(chart_of(seen)) {}
  bool Evaluate(double const* const* x, double* residual, double** J) const override {
    const Pose i(x[0]), j(x[1]), c(x[2]);
    const double rho = x[3][0];
    const Vec3 in_i = c.R * (host_ / rho) + c.p;
    const Vec3 in_j = j.R.transpose() * (i.R * in_i + i.p - j.p);
    const Vec3 X = c.R.transpose() * (in_j - c.p);
    const double depth = f_C_.dot(X);
    Eigen::Map<Vec2> r(residual);
    r = chart_ * X / (1.5 * depth);
    if (!J) return true;
    const Mat23 by_X = (chart_ / 1.5 - r * f_C_.transpose()) / depth;
    const Mat23 by_in_j = by_X * c.R.transpose();
    const Mat23 by_world = by_in_j * j.R.transpose();
    if (J[0]) {
      Eigen::Map<RowMajor<2, 7>> m(J[0]);
      m << by_world, -by_world * i.R * hat(in_i), Vec2::Zero();
    }
    if (J[1]) {
      Eigen::Map<RowMajor<2, 7>> m(J[1]);
      m << -by_world, by_in_j * hat(in_j), Vec2::Zero();
    }
    if (J[2]) return false;  // held
    if (J[3]) Eigen::Map<Vec2>{J[3]} = by_world * i.R * c.R * host_ * (-1 / (rho * rho));
    return true;
  }

 private:
  Vec3 host_, f_C_;
  Mat23 chart_;
};

/// Blocks: pose i, (v, b_a, b_g)_i, pose j, (v, b_a, b_g)_j.
class Inertial final : public ceres::SizedCostFunction<15, 7, 9, 7, 9> {
 public:
  Inertial(const Preintegration& z, const Mat15& L_inverse) : z_(z), W_(L_inverse) {}
  bool Evaluate(double const* const* x, double* residual, double** J) const override {
    const Pose i(x[0]), j(x[2]);
    const Eigen::Map<const Vec3> v_i(x[1]), a_i(x[1] + 3), g_i(x[1] + 6), v_j(x[3]), a_j(x[3] + 3), g_j(x[3] + 6);
    const double T = z_.T;
    const Vec3 gravity(0, 0, -9.81), da = a_i - z_.b_a, dg = g_i - z_.b_g;
    const auto of = [&](int row, int column) -> Mat3 { return z_.J.block<3, 3>(row, column); };
    const Vec3 turn = of(3, 12) * dg;
    const Mat3 dR = z_.dR * exp_of(turn).toRotationMatrix(), RiT = i.R.transpose();
    const Vec3 moved = RiT * (j.p - i.p - v_i * T - 0.5 * gravity * T * T), sped = RiT * (v_j - v_i - gravity * T);
    const Vec3 r_theta = log_of(Quaterniond(Mat3(dR.transpose() * RiT * j.R)));
    Vec15 r;
    r << moved - z_.dp - of(0, 9) * da - of(0, 12) * dg, r_theta, sped - z_.dv - of(6, 9) * da - of(6, 12) * dg,
        a_j - a_i, g_j - g_i;
    Eigen::Map<Vec15>(residual).noalias() = W_ * r;
    if (!J) return true;
    const Mat3 Jr = inverse_right_jacobian(r_theta), I = Mat3::Identity();
    if (J[0]) {
      Eigen::Matrix<double, 15, 7> m = Eigen::Matrix<double, 15, 7>::Zero();
      m.block<3, 3>(0, 0) = -RiT;
      m.block<3, 3>(0, 3) = hat(moved);
      m.block<3, 3>(3, 3) = -Jr * j.R.transpose() * i.R;
      m.block<3, 3>(6, 3) = hat(sped);
      Eigen::Map<RowMajor<15, 7>>(J[0]).noalias() = W_ * m;
    }
    if (J[1]) {
      Eigen::Matrix<double, 15, 9> m = Eigen::Matrix<double, 15, 9>::Zero();
      m.block<3, 3>(0, 0) = -RiT * T;
      m.block<3, 3>(6, 0) = -RiT;
      m.block<3, 3>(0, 3) = -of(0, 9);
      m.block<3, 3>(6, 3) = -of(6, 9);
      m.block<3, 3>(9, 3) = -I;
      m.block<3, 3>(0, 6) = -of(0, 12);
      m.block<3, 3>(6, 6) = -of(6, 12);
      m.block<3, 3>(12, 6) = -I;
      const Mat3 right = inverse_right_jacobian(turn).inverse();
      m.block<3, 3>(3, 6) = -Jr * exp_of(r_theta).toRotationMatrix().transpose() * right * of(3, 12);
      Eigen::Map<RowMajor<15, 9>>(J[1]).noalias() = W_ * m;
    }
    if (J[2]) {
      Eigen::Matrix<double, 15, 7> m = Eigen::Matrix<double, 15, 7>::Zero();
      m.block<3, 3>(0, 0) = RiT;
      m.block<3, 3>(3, 3) = Jr;
      Eigen::Map<RowMajor<15, 7>>(J[2]).noalias() = W_ * m;
    }
    if (J[3]) {
      Eigen::Matrix<double, 15, 9> m = Eigen::Matrix<double, 15, 9>::Zero();
      m.block<3, 3>(6, 0) = RiT;
      m.block<3, 3>(9, 3) = I;
      m.block<3, 3>(12, 6) = I;
      Eigen::Map<RowMajor<15, 9>>(J[3]).noalias() = W_ * m;
    }
    return true;
  }

 private:
  Preintegration z_;
  Mat15 W_;
};

/// The first frame's prior: whitened difference from where it was.
class First final : public ceres::SizedCostFunction<15, 7, 9> {
 public:
  First(const NavState& x0, const Mat15& H) : x0_(x0), U_(Eigen::LLT<Mat15>(H).matrixU()) {}
  bool Evaluate(double const* const* x, double* residual, double** J) const override {
    const Pose now(x[0]);
    Vec15 d;
    d << now.p - x0_.p, log_of(Quaterniond(Mat3(x0_.R.transpose() * now.R))), Eigen::Map<const Vec9>(x[1]);
    d.segment<3>(6) -= x0_.v;
    d.segment<3>(9) -= x0_.b_a;
    d.tail<3>() -= x0_.b_g;
    Eigen::Map<Vec15>(residual).noalias() = U_ * d;
    if (J && J[0]) {
      Eigen::Map<RowMajor<15, 7>> m(J[0]);
      m.leftCols<6>() = U_.leftCols<6>();
      m.col(6).setZero();
    }
    if (J && J[1]) Eigen::Map<RowMajor<15, 9>>{J[1]} = U_.rightCols<9>();
    return true;
  }

 private:
  NavState x0_;
  Mat15 U_;
};

/// The window's parameters in Ceres' shape.
struct Parameters {
  std::vector<std::array<double, 7>> pose;
  std::vector<std::array<double, 9>> motion;
  std::array<double, 7> extrinsics;
  std::vector<double> inverse_distance;  ///< of every track of the window
  std::vector<int> host;                 ///< -1: not used

  Parameters(const Window& w, ReprojectionFactor& factor) {
    auto put = [](const Vec3& p, const Mat3& R, double* x) {
      Eigen::Map<Vec3>{x} = p;
      Eigen::Map<Quaterniond>(x + 3) = Quaterniond(R);
    };
    for (int k = 0; k < w.size(); ++k) {
      const NavState& x = w.at(k).x;
      put(x.p, x.R, pose.emplace_back().data());
      Eigen::Map<Vec9>(motion.emplace_back().data()) << x.v, x.b_a, x.b_g;
    }
    put(w.calibration.p_BC, w.calibration.R_BC, extrinsics.data());
    for (int i = 0; i < w.track_count(); ++i) {
      inverse_distance.push_back(factor.landmark(i).inverse_distance);
      int h = 0;
      while (!w.seen(w.track(i), h)) ++h;
      host.push_back(w.views(w.track(i)) >= 2 ? h : -1);
    }
  }
};

enum class Part : std::uint8_t { kVisual, kAll };

/// Builds the problem. Ceres finds by itself that the depths are what DENSE_SCHUR can eliminate first.
void build(const Window& w, Parameters& x, Part part, ceres::Problem& problem) {
  for (auto& p : x.pose) problem.AddParameterBlock(p.data(), 7, new PoseManifold);
  problem.AddParameterBlock(x.extrinsics.data(), 7, new PoseManifold);
  problem.SetParameterBlockConstant(x.extrinsics.data());
  if (part == Part::kAll) {
    const Mat15 H = Eigen::Map<const Eigen::Matrix<double, 15, 15, Eigen::RowMajor>, 0, Eigen::OuterStride<>>(
        w.prior.H[0], Eigen::OuterStride<>(kMarginalStride));
    problem.AddResidualBlock(new First(w.prior.x0[0], H), nullptr, x.pose[0].data(), x.motion[0].data());
    for (std::size_t k = 1; k < x.pose.size(); ++k) {
      const Slot& s = w.at(static_cast<int>(k));
      problem.AddResidualBlock(new Inertial(s.imu, s.L_inverse.leftCols<15>()), nullptr, x.pose[k - 1].data(),
                               x.motion[k - 1].data(), x.pose[k].data(), x.motion[k].data());
    }
  }
  auto* const loss = new ceres::HuberLoss(1);
  for (std::size_t i = 0; i < x.host.size(); ++i) {
    const TrackRecord& t = w.track(static_cast<int>(i));
    for (int k = x.host[i] + 1; x.host[i] >= 0 && k < w.size(); ++k)
      if (w.seen(t, k))
        problem.AddResidualBlock(new Projection(w.view(t, x.host[i]), w.view(t, k)), loss,
                                 x.pose[static_cast<std::size_t>(x.host[i])].data(),
                                 x.pose[static_cast<std::size_t>(k)].data(), x.extrinsics.data(),
                                 &x.inverse_distance[i]);
  }
}

ceres::Solver::Summary solve(ceres::Problem& problem) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.trust_region_strategy_type = ceres::DOGLEG;
  options.max_num_iterations = kIterations;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary;
}

SyntheticWindow usual_window() {
  SyntheticWindow s = make_window({.frames = 11, .tracks = 290, .pixel_noise = 1});
  set_initial_prior(*s.window, {}, CalibrationTangent::Constant(5e-3));
  s.window->prior.x0[0] = s.truth[0];
  s.window->first_estimates = false;
  return s;
}

double relative(const MatrixXd& a, const MatrixXd& b) { return (a - b).norm() / b.norm(); }

bool agree(const char* what, double difference, double limit) {
  std::printf("%-52s %9.2e (limit %.0e)\n", what, difference, limit);
  return difference < limit;
}

/// Cost, gradient and normal equations of the visual part, and the cost of the whole, in both.
bool same_problem() {
  SyntheticWindow s = usual_window();
  Window& w = *s.window;
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(w, {});
  const auto ours = std::make_unique<VisualSystem>();
  factor.linearise(w, *ours);
  Parameters x(w, factor);

  ceres::Problem visual;
  build(w, x, Part::kVisual, visual);
  ceres::Problem::EvaluateOptions order;
  for (auto& p : x.pose) order.parameter_blocks.push_back(p.data());
  for (std::size_t i = 0; i < x.host.size(); ++i)
    if (x.host[i] >= 0) order.parameter_blocks.push_back(&x.inverse_distance[i]);
  double cost = 0;
  std::vector<double> gradient;
  ceres::CRSMatrix sparse;
  visual.Evaluate(order, &cost, nullptr, &gradient, &sparse);
  MatrixXd J = MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
  for (int r = 0; r < sparse.num_rows; ++r)
    for (int q = sparse.rows[static_cast<std::size_t>(r)]; q < sparse.rows[static_cast<std::size_t>(r) + 1]; ++q)
      J(r, sparse.cols[static_cast<std::size_t>(q)]) = sparse.values[static_cast<std::size_t>(q)];
  const int poses = 6 * w.size(), depths = sparse.num_cols - poses;
  const MatrixXd H = J.transpose() * J;
  const VectorXd b = -Eigen::Map<const VectorXd>(gradient.data(), poses + depths);
  const MatrixXd gain = H.topRightCorner(poses, depths) * H.bottomRightCorner(depths, depths).inverse();
  const MatrixXd reduced = H.topLeftCorner(poses, poses) - gain * H.bottomLeftCorner(depths, poses);
  const VectorXd reduced_b = b.head(poses) - gain * b.tail(depths);

  MatrixXd our_H(poses, poses);
  VectorXd our_b(poses);
  auto turn = [&](int k) {  // from the body's turn to the world's
    Eigen::Matrix<double, 6, 6> T = Eigen::Matrix<double, 6, 6>::Identity();
    T.bottomRightCorner<3, 3>() = w.at(k).x.R;
    return T;
  };
  for (int k = 0; k < w.size(); ++k) {
    our_b.segment<6>(6 * k) = turn(k).transpose() * Eigen::Map<const Vec6>(ours->b[k]);
    for (int l = k; l < w.size(); ++l) {
      our_H.block<6, 6>(6 * k, 6 * l) = turn(k).transpose() * Eigen::Map<const RowMajor<6, 6>>(ours->H[k][l]) * turn(l);
      our_H.block<6, 6>(6 * l, 6 * k) = our_H.block<6, 6>(6 * k, 6 * l).transpose();
    }
  }

  ceres::Problem all;
  build(w, x, Part::kAll, all);
  double cost_all = 0;
  all.Evaluate({}, &cost_all, nullptr, nullptr, nullptr);
  Solver solver(best_instruction_set());
  const double our_cost_all = solver.linearise(w, factor, kSettings);

  bool same = agree("visual cost", std::abs(ours->cost - 2 * cost) / (2 * cost), 1e-9);
  same &= agree("visual gradient, depths eliminated", relative(our_b, reduced_b), 1e-9);
  same &= agree("visual normal equations, depths eliminated", relative(our_H, reduced), 1e-9);
  same &= agree("cost with IMU and prior", std::abs(our_cost_all - 2 * cost_all) / (2 * cost_all), 1e-9);
  return same;
}

using Clock = std::chrono::steady_clock;
double milliseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}
double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

/// One after the other, from the same states and depths, so that both meet the same minutes of the machine.
void compare_times() {
  const SyntheticWindow s = usual_window();
  ReprojectionFactor factor(best_instruction_set());
  TrackFactor track(best_instruction_set());
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  const auto work = std::make_unique<Window>(*s.window);
  std::vector<double> ours, tracks, ceres_build, ceres_solve;
  double our_cost = 0, ceres_cost = 0;
  int our_steps = 0, ceres_steps = 0, residuals = 0;
  for (int i = 0; i < 25; ++i) {
    *work = *s.window;
    factor.restart();
    factor.collect(*work, {});  // triangulates, which is no part of the solution
    Parameters x(*work, factor);
    Clock::time_point begin = Clock::now();
    factor.collect(*work, {});
    const SolverSummary r = solver.optimise(*work, factor, kSettings, supervisor);
    ours.push_back(milliseconds_since(begin));
    our_cost = r.cost;
    residuals = r.residuals;
    our_steps = r.accepted + r.rejected;

    begin = Clock::now();
    ceres::Problem problem;
    build(*s.window, x, Part::kAll, problem);
    ceres_build.push_back(milliseconds_since(begin));
    begin = Clock::now();
    const ceres::Solver::Summary summary = solve(problem);
    ceres_solve.push_back(milliseconds_since(begin));
    ceres_cost = 2 * summary.final_cost;
    ceres_steps = static_cast<int>(summary.iterations.size()) - 1;

    *work = *s.window;
    begin = Clock::now();
    track.collect(*work, {});
    solver.optimise(*work, track, kSettings, supervisor);
    tracks.push_back(milliseconds_since(begin));
  }
  std::printf("%d landmarks, %d bearings against them\n", factor.unknowns(), residuals / 2);
  std::printf("%-28s %7.3f ms  %d steps  cost %.6f\n", "reprojection, ours", median(ours), our_steps, our_cost);
  std::printf("%-28s %7.3f ms  %d steps  cost %.6f  (and %.3f ms to build the problem)\n", "reprojection, Ceres",
              median(ceres_solve), ceres_steps, ceres_cost, median(ceres_build));
  std::printf("%-28s %7.3f ms\n", "track factor, same window", median(tracks));
  std::printf("%-28s 1 : %.1f, for each step 1 : %.1f\n\n", "ours : Ceres", median(ceres_solve) / median(ours),
              median(ceres_solve) / ceres_steps / (median(ours) / our_steps));
}

void reprojection_in_ours(benchmark::State& state) {
  const SyntheticWindow s = usual_window();
  ReprojectionFactor factor(best_instruction_set());
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  const auto work = std::make_unique<Window>(*s.window);
  for (auto _ : state) {
    state.PauseTiming();
    *work = *s.window;
    factor.restart();
    factor.collect(*work, {});
    state.ResumeTiming();
    factor.collect(*work, {});
    benchmark::DoNotOptimize(solver.optimise(*work, factor, kSettings, supervisor));
  }
}

void reprojection_in_ceres(benchmark::State& state) {
  const SyntheticWindow s = usual_window();
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(*s.window, {});
  for (auto _ : state) {
    Parameters x(*s.window, factor);
    ceres::Problem problem;
    build(*s.window, x, Part::kAll, problem);
    benchmark::DoNotOptimize(solve(problem).final_cost);
  }
}

BENCHMARK(reprojection_in_ours)->Unit(benchmark::kMillisecond);
BENCHMARK(reprojection_in_ceres)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace epiline

int main(int argc, char** argv) {
  if (!epiline::same_problem()) {
    std::fprintf(stderr, "epiline: error: ours and Ceres do not mean the same problem\n");
    return 1;
  }
  epiline::compare_times();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
