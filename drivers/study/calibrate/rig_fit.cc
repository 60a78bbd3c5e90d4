#include "drivers/study/calibrate/rig_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "drivers/flights/motion/readings.h"
#include "drivers/study/calibrate/lens_columns.h"
#include "drivers/study/calibrate/rig_factors.h"
#include "drivers/study/calibrate/rig_uncertainty.h"
#include "estimator/geometry/so3.h"
#include "estimator/inertial/nav_state.h"
#include "platform/math/statistics.h"

namespace epiline {

namespace {

/// Where in a piece of the splines the first reading lies; see motion_fit.cc.
constexpr double kLead = 0.42;
/// Images this close to the ends are left out, so that the time offset may move.
constexpr double kMargin_s = 0.1;
/// Of the priors: sensors are better than this, so that what a recording cannot tell stays sane.
constexpr double kGainSigma = 0.03, kApart_m = 0.01, kGyroscopeBiasSigma = 0.2, kAccelerometerBiasSigma = 0.5,
                 kLeverSigma_m = 0.5;
/// Of a board's size, logarithmic: somebody wrote millimetres of another board, or a printer fitted it to the page.
constexpr double kSizeSigma = 0.5;
/// A size differs from the described one beyond so many sigmas and this share, which a ruler sees.
constexpr double kOtherSize = 3, kRuler = 0.01, kSizeHeld = 1e-7;

class Rig {
 public:
  Rig(const std::vector<CornerView>& views, const LensFit& lens, const TurnAlignment& turns,
      const std::vector<ImuSample>& imu, const RigFitSettings& settings)
      : settings_(settings) {
    const Span offset = Span::from_seconds(turns.time_offset_s);
    cut(views, lens, imu, offset);
    if (problem_.readings.size() < 10 || views_.empty()) return;
    start(lens, turns);
  }

  double seconds() const { return state_.duration_s; }

  /// First with a board of any size, since the accelerometer knows metres; then with the described one if it can be.
  bool run() {
    if (!settle()) return false;
    size_ = std::log(state_.constants.shape.scale);
    size_sigma_ = uncertainty_.sigma(RigColumns(0, state_.constants.lens.model).board_size);
    if (std::abs(size_) > std::max(kOtherSize * size_sigma_, kRuler)) return true;
    hold_size_ = true;
    state_.constants.shape.scale = 1;
    if (!settle()) return false;
    state_.constants.shape.scale = 1;  // which a prior holds to some digits
    return true;
  }

  RigFit take() {
    RigFit fit;
    fit.noise = problem_.noise;
    fit.uncertainty = std::move(uncertainty_);
    fit.views = problem_.views.size();
    fit.board_size = size_;
    fit.board_size_sigma = size_sigma_;
    const RigLayout layout(state_);
    const RigFactors factors(state_, layout);
    double sum = 0;
    for (const RigView& view : problem_.views) {
      factors.each_corner(factors.look(view.t_s), *view.view, [&](const BoardCorner& corner, const Vec2& e, auto&...) {
        if (e.norm() > 6 * fit.noise.corner_px) {
          ++fit.outliers;
          return;
        }
        sum += e.squaredNorm();
        fit.corners.push_back({view.t_s, corner.id, corner.px, e});
      });
    }
    fit.rms_px = fit.corners.empty() ? 0 : std::sqrt(sum / static_cast<double>(fit.corners.size()));
    fit.state = std::move(state_);
    return fit;
  }

 private:
  bool settle() {
    const RigLayout layout(state_);
    FitEquations equations(layout.first);
    std::vector<double> step;
    // Weights and noise change with the fit: the last digits come slowly, and nobody needs them. Of some lenses the
    // numbers are hardly told apart (a double sphere of a narrow view): those go slowly too.
    constexpr int kMost = 40;
    constexpr double kSettled = 2e-6, kGoodEnough = 1e-4, kUndamped = 1e-6;
    const int lens = layout.columns.lens, lens_count = layout.columns.R_BC - lens;
    double moved = 0, damping = 1e-2;
    for (int i = 1; i <= kMost; ++i, damping *= 0.3) {
      if (++iterations_ > 1) measure_noise(layout);
      linearise(layout, equations);
      equations.damp_by_share(lens, lens_count, damping);
      if (!equations.solve(step)) return false;
      moved = state_.move(step, layout.knot, layout.bias, layout.columns, layout.corners);
      if (!(moved < 10)) return false;
      if (moved < kSettled && damping < kUndamped) break;
    }
    if (!(moved < kGoodEnough)) return false;
    linearise(layout, equations);
    if (!equations.solve(step)) return false;
    uncertainty_ = uncertainty_of(state_, layout, equations, problem_);
    return true;
  }

  /// A view whose pose is known at the start.
  struct KnownPose {
    double t_s;  ///< in the IMU's time
    BoardPose pose;
  };

  /// The time that both cover.
  void cut(const std::vector<CornerView>& views, const LensFit& lens, const std::vector<ImuSample>& imu, Span offset) {
    std::size_t first = 0, last = views.size();
    while (first < last && !lens.poses[first]) ++first;
    while (last > first && !lens.poses[last - 1]) --last;
    if (first == last) return;
    const HostStamp from = views[first].stamp + offset, to = views[last - 1].stamp + offset;
    for (const ImuSample& s : imu) {
      if (s.stamp < from || s.stamp > to) continue;
      if (problem_.readings.empty()) state_.begin = s.stamp;
      problem_.readings.push_back(
          {(s.stamp - state_.begin).seconds(), vec3(s.angular_velocity_rad_s), vec3(s.specific_force_m_s2)});
    }
    if (problem_.readings.size() < 10) return;
    period_s_ = problem_.readings.back().t_s / static_cast<double>(problem_.readings.size() - 1);
    state_.interval_s = std::max(2 * period_s_, 0.01);
    state_.lead_s = kLead * state_.interval_s;
    const double end = problem_.readings.back().t_s;
    pieces_ = static_cast<std::size_t>(std::lround((end + state_.lead_s) / state_.interval_s));
    state_.duration_s = std::min(end, static_cast<double>(pieces_) * state_.interval_s - state_.lead_s);
    while (problem_.readings.back().t_s > state_.duration_s) problem_.readings.pop_back();
    for (std::size_t i = first; i < last; ++i) {
      const double t = (views[i].stamp - state_.begin).seconds(), t_imu = t + offset.seconds();
      if (t_imu < kMargin_s || t_imu > state_.duration_s - kMargin_s || views[i].corners.empty()) continue;
      problem_.views.push_back({t, &views[i]});
      if (lens.poses[i]) views_.push_back({t_imu, *lens.poses[i]});
    }
  }

  /// The gyroscope's orientation since the first reading, at each.
  std::vector<Mat3> integrated(const Vec3& bias) const {
    std::vector<Mat3> R = {Mat3::Identity()};
    const auto& r = problem_.readings;
    for (std::size_t i = 1; i < r.size(); ++i)
      R.push_back(R.back() * so3_exp((r[i].t_s - r[i - 1].t_s) * (0.5 * (r[i - 1].w + r[i].w) - bias)));
    return R;
  }

  /// Knots from the views' poses, rotations between them from the gyroscope.
  void start(const LensFit& lens, const TurnAlignment& turns) {
    RigConstants& c = state_.constants;
    c.lens = lens.lens;
    c.shape = lens.shape;
    c.R_BC = turns.R_BC;
    c.time_offset_s = turns.time_offset_s;
    const std::vector<Mat3> R_0B = integrated(turns.gyroscope_bias);
    const auto& readings = problem_.readings;
    const auto turned_at = [&](double t) -> Mat3 {
      const double s = std::clamp(t, 0.0, readings.back().t_s);
      const auto after = std::upper_bound(readings.begin() + 1, readings.end() - 1, s,
                                          [](double a, const RigReading& r) { return a < r.t_s; });
      const auto i = static_cast<std::size_t>(after - readings.begin()) - 1;
      return R_0B[i] * so3_exp((s - readings[i].t_s) * (readings[i].w - turns.gyroscope_bias));
    };
    for (std::size_t k = 0; k < pieces_ + 3; ++k) {
      const double t = (static_cast<double>(k) - 1) * state_.interval_s - state_.lead_s;
      const auto after = std::upper_bound(views_.begin(), views_.end(), t,
                                          [](double s, const KnownPose& view) { return s < view.t_s; });
      const KnownPose &b = after == views_.end() ? views_.back() : *after,
                      &a = after == views_.begin() ? views_.front() : *(after - 1);
      const double u = b.t_s > a.t_s ? std::clamp((t - a.t_s) / (b.t_s - a.t_s), 0.0, 1.0) : 0;
      const KnownPose& near = u < 0.5 ? a : b;
      const Mat3 R_TB = near.pose.R_CT.transpose() * c.R_BC.transpose();
      state_.R_TB.push_back(R_TB * turned_at(near.t_s).transpose() * turned_at(t));
      state_.p_TB.push_back((1 - u) * place_of(a.pose) + u * place_of(b.pose));
    }
    state_.bias_interval_s = settings_.bias_interval_s;
    const auto knots = static_cast<std::size_t>(std::ceil(state_.duration_s / state_.bias_interval_s)) + 1;
    state_.gyroscope_bias.assign(std::max<std::size_t>(knots, 2), turns.gyroscope_bias);
    state_.accelerometer_bias.assign(state_.gyroscope_bias.size(), Vec3::Zero());
    Vec3 mean_T = Vec3::Zero();
    for (const KnownPose& view : views_) {
      const auto after = std::lower_bound(readings.begin(), readings.end() - 1, view.t_s,
                                          [](const RigReading& r, double s) { return r.t_s < s; });
      mean_T += view.pose.R_CT.transpose() * c.R_BC.transpose() * after->a;
    }
    c.g_T = -kGravity_W.norm() * mean_T.normalized();
    const double rate = 1 / period_s_;
    problem_.noise.corner_px = lens.sigma_px;
    problem_.noise.gyroscope = settings_.noise.gyroscope_density * std::sqrt(rate);
    problem_.noise.accelerometer = settings_.noise.accelerometer_density * std::sqrt(rate);
  }
  static Vec3 place_of(const BoardPose& pose) { return -pose.R_CT.transpose() * pose.t_CT; }

  /// Standard deviations by medians of what remains; the splines take a share of the IMU's noise for motion.
  void measure_noise(const RigLayout& layout) {
    RigNoise& noise = problem_.noise;
    const RigFactors factors(state_, layout);
    std::vector<double> w, a, px;
    for (const RigReading& reading : problem_.readings) {
      for (const double e : factors.gyroscope(reading, 1).e) w.push_back(std::abs(e));
      for (const double e : factors.accelerometer(reading, 1).e) a.push_back(std::abs(e));
    }
    for (const RigView& view : problem_.views) {
      factors.each_corner(factors.look(view.t_s), *view.view,
                          [&](const BoardCorner&, const Vec2& e, auto&...) { px.push_back(e.squaredNorm()); });
    }
    const double free = 1 - static_cast<double>(pieces_) / static_cast<double>(problem_.readings.size());
    const auto sigma = [&](std::vector<double> values) {
      return summarise(std::move(values)).median / 0.6745 / std::sqrt(free);
    };
    noise.gyroscope = std::max(sigma(std::move(w)), 1e-6);
    noise.accelerometer = std::max(sigma(std::move(a)), 1e-5);
    // The squared error of two coordinates has its median at 2 ln 2 of one's variance.
    noise.corner_px = std::max(std::sqrt(summarise(std::move(px)).median / (2 * std::log(2.0))), 1e-3);
    noise.gyroscope_density = noise.gyroscope * std::sqrt(period_s_);
    noise.accelerometer_density = noise.accelerometer * std::sqrt(period_s_);
  }

  void linearise(const RigLayout& layout, FitEquations& equations) const {
    equations.clear();
    const RigFactors factors(state_, layout);
    const RigNoise& noise = problem_.noise;
    for (const RigReading& reading : problem_.readings) {
      equations.add(weighted(factors.gyroscope(reading, 1), noise.gyroscope));
      equations.add(weighted(factors.accelerometer(reading, 1), noise.accelerometer));
    }
    for (const RigView& view : problem_.views) add_view(factors, layout, view, equations);
    add_expectations(layout, equations);
  }

  void add_view(const RigFactors& factors, const RigLayout& layout, const RigView& view,
                FitEquations& equations) const {
    const RigFactors::View at = factors.look(view.t_s);
    const int begin = layout.columns.begin, count = layout.columns.gravity - begin;
    Eigen::MatrixXd N = Eigen::MatrixXd::Zero(6 + count, 6 + count);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(6 + count);
    const auto add = [&](const BoardCorner& corner, const Vec2& e, const CornerJacobian& J, const Mat23& by_corner) {
      const double weight = corner_weight(e, problem_.noise);
      N.noalias() += weight * J.transpose() * J;
      b.noalias() += weight * J.transpose() * e;
      const int column = factors.column(corner);
      const Eigen::MatrixXd mixed = weight * by_corner.transpose() * J;
      for (std::size_t k = 0; k < 4; ++k) equations.add_block(column, at.knot[k], at.weight[k] * mixed.leftCols<6>());
      equations.add_block(column, begin, mixed.rightCols(count));
      equations.add_block(column, column, weight * by_corner.transpose() * by_corner);
      equations.add_to_b(column, weight * by_corner.transpose() * e);
    };
    factors.each_corner(at, *view.view, add);
    for (std::size_t k = 0; k < 4; ++k) {
      for (std::size_t l = 0; l <= k; ++l)
        equations.add_block(at.knot[k], at.knot[l], at.weight[k] * at.weight[l] * N.topLeftCorner<6, 6>());
      equations.add_block(begin, at.knot[k], at.weight[k] * N.bottomLeftCorner(count, 6));
      equations.add_to_b(at.knot[k], at.weight[k] * b.head<6>());
    }
    equations.add_block(begin, begin, N.bottomRightCorner(count, count));
    equations.add_to_b(begin, b.tail(count));
  }

  /// What is known without measurements: biases stay about the same, sensors are about right.
  void add_expectations(const RigLayout& layout, FitEquations& equations) const {
    const Mat3 I = Mat3::Identity();
    const auto expect = [&](int column, const Vec3& excess, double sigma) {
      FitResidual r(excess, 1 / (sigma * sigma));
      r.add(column, I);
      equations.add(r);
    };
    const auto stay = [&](std::size_t m, int part, const std::vector<Vec3>& bias, double sigma) {
      FitResidual r(bias[m + 1] - bias[m], 1 / (sigma * sigma));
      r.add(layout.bias[m] + part, -I);
      r.add(layout.bias[m + 1] + part, I);
      equations.add(r);
    };
    const double root = std::sqrt(state_.bias_interval_s);
    for (std::size_t m = 0; m + 1 < layout.bias.size(); ++m) {
      stay(m, 0, state_.gyroscope_bias, settings_.noise.gyroscope_random_walk * root);
      stay(m, 3, state_.accelerometer_bias, settings_.noise.accelerometer_random_walk * root);
    }
    expect(layout.bias[0], state_.gyroscope_bias[0], kGyroscopeBiasSigma);
    expect(layout.bias[0] + 3, state_.accelerometer_bias[0], kAccelerometerBiasSigma);
    const RigConstants& c = state_.constants;
    expect(layout.columns.p_BC, c.p_BC, kLeverSigma_m);
    for (int i = 0; i < c.shape.corners(); ++i) expect(layout.corners + 3 * i, c.shape.offset(i), c.shape.sigma_m());
    expect(layout.columns.gyroscope_gain, c.gyroscope_gain - Vec3::Ones(), kGainSigma);
    expect(layout.columns.accelerometer_gain, c.accelerometer_gain - Vec3::Ones(), kGainSigma);
    expect(layout.columns.accelerometer_y, c.accelerometers_B.col(1), kApart_m);
    expect(layout.columns.accelerometer_z, c.accelerometers_B.col(2), kApart_m);
    // The outermost knots are hardly seen: they stay where they are rather than nowhere.
    for (const int column : layout.knot) equations.damp(column, 6, 1e-2);
    equations.damp(layout.columns.begin, layout.columns.count(), 1e-6);
    const double size_sigma = hold_size_ ? kSizeHeld : kSizeSigma;
    FitResidual size(Vec3(std::log(c.shape.scale), 0, 0), 1 / (size_sigma * size_sigma));
    size.add(layout.columns.board_size, Mat3::Identity(), 1);
    equations.add(size);
    if (settings_.hold_lens) equations.damp(layout.columns.lens, lens_columns(c.lens.model), 1e12);
  }

  RigFitSettings settings_;
  RigState state_;
  RigProblem problem_;
  RigUncertainty uncertainty_;
  std::vector<KnownPose> views_;
  double period_s_ = 0;
  std::size_t pieces_ = 0;
  int iterations_ = 0;
  double size_ = 0, size_sigma_ = 0;
  bool hold_size_ = false;
};

}  // namespace

Result<RigFit> fit_rig(const std::vector<CornerView>& views, const LensFit& lens, const TurnAlignment& turns,
                       const std::vector<ImuSample>& imu, const RigFitSettings& settings) {
  if (const Status s = check_readings(imu, "IMU"); !s) return s.error();
  Rig rig(views, lens, turns, imu, settings);
  if (rig.seconds() < kShortestRig_s) {
    return Error{ErrorKind::kRun, "", 0, fmt::format("{:.1f} s in which board and IMU are both there", rig.seconds()),
                 fmt::format("{} s at least; a minute is good", kShortestRig_s)};
  }
  if (!rig.run()) {
    return Error{ErrorKind::kRun, "", 0, "no rig explains both the corners and the IMU's readings",
                 "accelerations in m/s^2, rates in rad/s, and a board of the described size"};
  }
  return rig.take();
}

}  // namespace epiline
