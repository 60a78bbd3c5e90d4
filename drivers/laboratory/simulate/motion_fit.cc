#include "drivers/laboratory/simulate/motion_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "drivers/flights/motion/motion_fit_equations.h"
#include "drivers/flights/motion/random.h"
#include "drivers/flights/motion/readings.h"
#include "drivers/laboratory/simulate/motion_agreement.h"
#include "estimator/geometry/so3.h"
#include "platform/math/statistics.h"

namespace epiline {
namespace {

/// A measurement with its time since the beginning.
struct Reading {
  double t_s;
  Vec3 w, a;
};
struct Pose {
  double t_s;
  Vec3 p;
  Mat3 R;
};

/// Of the length of the truth's quaternions. Files with six decimals are off by 1e-6.
constexpr double kNormTolerance = 1e-3;

/// The poses within the time that the IMU covers. Fails if and only if they cover less than settings.shortest_s, have a
/// gap longer than settings.longest_gap_s, or hold what is no pose.
Result<std::vector<TimedPose>> usable_poses(const std::vector<ImuSample>& imu, const Trajectory& truth,
                                            const FitSettings& settings) {
  const auto fail = [&](std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, settings.truth_name, 0, std::move(found), std::move(expected)};
  };
  const auto no_rotation = [&](HostStamp at) {
    return fail("at " + seconds_text(at) + " no position or no unit quaternion", "finite numbers, |q| = 1");
  };
  if (truth.worst_norm_error > kNormTolerance) return no_rotation(truth.worst_norm_at);
  std::vector<TimedPose> poses;
  for (const TimedPose& pose : truth.poses)
    if (!imu.empty() && pose.stamp >= imu.front().stamp && pose.stamp <= imu.back().stamp) poses.push_back(pose);
  const double covered = poses.empty() ? 0 : (poses.back().stamp - poses.front().stamp).seconds();
  if (covered < settings.shortest_s) {
    return fail(fmt::format("{:.3f} s in common with {}", covered, settings.imu_name),
                fmt::format("{:.3f} s at least", settings.shortest_s));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double norm = poses[i].q_WB.norm();
    if (!poses[i].p_WB.allFinite() || !(std::abs(norm - 1) < kNormTolerance)) return no_rotation(poses[i].stamp);
    if (i == 0) continue;
    const double gap = (poses[i].stamp - poses[i - 1].stamp).seconds();
    if (gap > settings.longest_gap_s) {
      return fail(fmt::format("at {} no pose for {:.3f} s", seconds_text(poses[i - 1].stamp), gap),
                  fmt::format("gaps up to {} s", settings.longest_gap_s));
    }
  }
  return poses;
}

/// The readings from the first to the last pose.
std::vector<ImuSample> within(const std::vector<ImuSample>& imu, const std::vector<TimedPose>& poses) {
  std::vector<ImuSample> inside;
  for (const ImuSample& s : imu)
    if (s.stamp >= poses.front().stamp && s.stamp <= poses.back().stamp) inside.push_back(s);
  return inside;
}

/// Where in a piece of the splines the first reading lies, and images that are taken with readings. Vibration above
/// what the splines can follow is in the readings but not in the motion; its share of a velocity is least about here.
constexpr double kLead = 0.42;

/// The constants; see FitSettings.
struct Constants {
  Mat3 R_WT = Mat3::Identity();  ///< from the truth's world, about `pivot`
  Mat3 R_MB = Mat3::Identity();
  Vec3 p_BM = Vec3::Zero();
  double time_offset_s = 0;
};

Vec3 segment(const std::vector<double>& step, int column) { return Eigen::Map<const Vec3>(step.data() + column); }

/// How far a distance from the truth counts (Cauchy), for a squared distance in standard deviations.
double robust_weight(double squared) { return 1 / (1 + squared / 9); }

/// With columns for those constants.
struct Layout : FitLayout {
  int tilt, mount, lever, time_offset;
  Layout(int knots, int biases, double knots_per_bias)
      : FitLayout(knots, biases, knots_per_bias),
        tilt(add_constants(2)),
        mount(add_constants(3)),
        lever(add_constants(3)),
        time_offset(add_constants(1)) {}
};

class Fitter {
 public:
  Fitter(const std::vector<ImuSample>& imu, const ImuNoise& noise, const std::vector<TimedPose>& truth,
         const FitSettings& settings)
      : settings_(settings), noise_(noise), begin_(imu.front().stamp) {
    for (const ImuSample& s : imu)
      readings_.push_back({(s.stamp - begin_).seconds(), vec3(s.angular_velocity_rad_s), vec3(s.specific_force_m_s2)});
    for (const TimedPose& pose : truth)
      poses_.push_back({(pose.stamp - begin_).seconds(), pose.p_WB, pose.q_WB.toRotationMatrix()});
    const double imu_rate = 1 / median_period(imu), truth_rate = 1 / median_period(truth);
    sigma_w_ = noise.gyroscope_density * std::sqrt(imu_rate);
    sigma_a_ = noise.accelerometer_density * std::sqrt(imu_rate);
    sigma_p_ = settings.position_density * std::sqrt(truth_rate);
    sigma_R_ = settings.rotation_density * std::sqrt(truth_rate);
    interval_s_ = settings.knot_interval_s > 0 ? settings.knot_interval_s : 2 / imu_rate;
    lead_s_ = kLead * interval_s_;
    end_with_half_a_piece();
    for (const Pose& pose : poses_) pivot_ += pose.p / static_cast<double>(poses_.size());
    bias_g_.assign(static_cast<std::size_t>(std::ceil(duration_s_ / settings.bias_interval_s)) + 1, Vec3::Zero());
    bias_a_ = walk_g_ = walk_a_ = bias_g_;
    recorded_ = poses_;
    if (settings.draw) perturb(*settings.draw);
    start();
  }

  /// False if the fit does not converge.
  bool run() {
    const Layout layout(static_cast<int>(p_.size()), static_cast<int>(bias_g_.size()),
                        settings_.bias_interval_s / interval_s_);
    FitEquations equations(layout.first);
    std::vector<double> step;
    constexpr int kMost = 50;
    for (iterations_ = 1; iterations_ <= kMost; ++iterations_) {
      linearise(layout, equations);
      if (!equations.solve(step)) return false;
      const double moved = apply(layout, step);
      if (!(moved < 10)) return false;
      if (moved < 1e-6) return true;
    }
    return false;
  }

  FittedMotion motion() const {
    return {begin_,
            duration_s_,
            {.position = {interval_s_, p_}, .rotation = {interval_s_, R_}, .lead_s = lead_s_},
            {.gyroscope = {settings_.bias_interval_s, bias_g_}, .accelerometer = {settings_.bias_interval_s, bias_a_}}};
  }

  void describe(FitReport& report) const;

 private:
  /// A last piece with next to no reading would leave its last knot free to go anywhere: the end is cut off instead.
  void end_with_half_a_piece() {
    const double last = readings_.back().t_s;
    pieces_ = static_cast<std::size_t>(std::lround((last + lead_s_) / interval_s_));
    duration_s_ = std::min(last, static_cast<double>(pieces_) * interval_s_ - lead_s_);
    while (readings_.back().t_s > duration_s_) readings_.pop_back();
    while (poses_.back().t_s > duration_s_) poses_.pop_back();
  }

  /// Adds to the measurements, and to the expectation that biases stay, one draw of the noise each is assumed to have.
  /// The most probable motion of those is a draw from the distribution of the motion given the true ones (exact for
  /// linear Gaussian problems).
  void perturb(std::uint64_t seed) {
    Random gyroscope(seed, 101), accelerometer(seed, 102), position(seed, 103), rotation(seed, 104), walk(seed, 105);
    for (Reading& r : readings_) {
      r.w += gyroscope.normal3(sigma_w_);
      r.a += accelerometer.normal3(sigma_a_);
    }
    for (Pose& pose : poses_) {
      pose.p += position.normal3(sigma_p_);
      pose.R = pose.R * so3_exp(rotation.normal3(sigma_R_));
    }
    const double root = std::sqrt(settings_.bias_interval_s);
    for (std::size_t m = 0; m < walk_g_.size(); ++m) {
      walk_g_[m] = walk.normal3(noise_.gyroscope_random_walk * root);
      walk_a_[m] = walk.normal3(noise_.accelerometer_random_walk * root);
    }
  }

  std::vector<Pose>::const_iterator truth_after(double t) const {
    return std::upper_bound(poses_.begin() + 1, poses_.end() - 1, t,
                            [](double s, const Pose& pose) { return s < pose.t_s; });
  }
  /// Pose of the truth at a time, straight lines between its poses.
  Pose truth_at(double t) const {
    const auto after = truth_after(t);
    const Pose &a = *(after - 1), &b = *after;
    const double u = std::clamp((t - a.t_s) / (b.t_s - a.t_s), 0.0, 1.0);
    return {t, (1 - u) * a.p + u * b.p, a.R * so3_exp(u * so3_log(a.R.transpose() * b.R))};
  }
  double age_of_truth(double t) const {
    const auto after = truth_after(t);
    return std::min(std::abs(t - (after - 1)->t_s), std::abs(after->t_s - t));
  }

  /// The gyroscope's bias: median over half seconds of what the readings turn more than the truth.
  Vec3 rough_gyroscope_bias() const {
    std::array<std::vector<double>, 3> axes;
    for (std::size_t i = 0; i < readings_.size();) {
      Mat3 turned = Mat3::Identity();
      std::size_t j = i;
      for (; j + 1 < readings_.size() && readings_[j].t_s < readings_[i].t_s + 0.5; ++j)
        turned =
            turned * so3_exp(0.5 * (readings_[j].w + readings_[j + 1].w) * (readings_[j + 1].t_s - readings_[j].t_s));
      const double T = readings_[j].t_s - readings_[i].t_s;
      if (T < 0.4) break;
      const Mat3 true_turn = truth_at(readings_[i].t_s).R.transpose() * truth_at(readings_[j].t_s).R;
      const Vec3 excess = so3_log(true_turn.transpose() * turned) / T;
      for (int k = 0; k < 3; ++k) axes[static_cast<std::size_t>(k)].push_back(excess[k]);
      i = j;
    }
    const auto median = [&](std::size_t k) { return summarise(std::move(axes[k])).median; };
    return {median(0), median(1), median(2)};
  }

  /// Where the iteration starts: positions of the truth; rotations of the gyroscope, drawn to the truth where there is
  /// one.
  void start() {
    const std::size_t knots = pieces_ + 3;
    std::fill(bias_g_.begin(), bias_g_.end(), rough_gyroscope_bias());
    const Vec3 b_g = bias_g_.front();
    const auto knot_time = [&](std::size_t k) { return (static_cast<double>(k) - 1) * interval_s_ - lead_s_; };
    Mat3 R = truth_at(readings_.front().t_s).R;
    for (std::size_t i = 0; i < readings_.size(); ++i) {
      const bool last = i + 1 == readings_.size();
      const double t = readings_[i].t_s, next = last ? duration_s_ + 3 * interval_s_ : readings_[i + 1].t_s;
      const Vec3 w = (last ? readings_[i].w : (0.5 * (readings_[i].w + readings_[i + 1].w)).eval()) - b_g;
      while (R_.size() < knots && knot_time(R_.size()) < next)
        R_.push_back(R * so3_exp((knot_time(R_.size()) - t) * w));
      const double pull = age_of_truth(t) < 0.05 ? 2 * (next - t) : 0;
      R = R * so3_exp((next - t) * w);
      if (!last) R = R * so3_exp(pull * so3_log(R.transpose() * truth_at(next).R));
    }
    for (std::size_t k = 0; k < knots; ++k) p_.push_back(truth_at(knot_time(k)).p);
  }

  struct Place {
    SplinePlace motion;
    CubicWeights weights;
    std::size_t bias;
    double bias_u;
  };
  Place place(double t) const {
    const SplinePlace at = spline_place(t + lead_s_, interval_s_, p_.size());
    const double s = t / settings_.bias_interval_s;
    const double m = std::clamp(std::floor(s), 0.0, static_cast<double>(bias_g_.size() - 2));
    return {at, cubic_weights(at.u), static_cast<std::size_t>(m), s - m};
  }

  void linearise(const Layout& layout, FitEquations& equations) const {
    equations.clear();
    const FittedMotion current = motion();
    for (const Reading& r : readings_) add_reading(layout, current, r, equations);
    for (const Pose& pose : poses_) add_pose(layout, current, pose, equations);
    add_expectations(layout, equations);
  }

  /// Both residuals are turned into the world, where the derivatives by turns of the knots in the world are weights.
  void add_reading(const Layout& layout, const FittedMotion& current, const Reading& reading,
                   FitEquations& equations) const {
    const Place at = place(reading.t_s);
    const Motion m = current.at(reading.t_s);
    const Vec3 f_W = m.a_WB - kGravity_W;
    FitResidual w(m.R_WB * (reading.w - current.gyroscope_bias(reading.t_s) - m.omega_B), 1 / (sigma_w_ * sigma_w_));
    FitResidual a(m.R_WB * (reading.a - current.accelerometer_bias(reading.t_s)) - f_W, 1 / (sigma_a_ * sigma_a_));
    for (std::size_t i = 0; i < 4; ++i) {
      const int column = layout.knot[static_cast<std::size_t>(at.motion.piece) + i];
      w.add(column + 3, -at.weights.first[i] / interval_s_ * Mat3::Identity());
      a.add(column, -at.weights.second[i] / (interval_s_ * interval_s_) * Mat3::Identity());
      a.add(column + 3, -at.weights.value[i] * skew(f_W));
    }
    for (std::size_t i = 0; i < 2; ++i) {
      const int column = layout.bias[at.bias + i];
      const double weight = i == 0 ? 1 - at.bias_u : at.bias_u;
      w.add(column, -weight * m.R_WB);
      a.add(column + 3, -weight * m.R_WB);
    }
    equations.add(w);
    equations.add(a);
  }

  struct PoseError {
    Vec3 position, rotation;  ///< the motion's minus the truth's; the truth's minus the motion's in the world
  };
  PoseError pose_error(const Motion& m, const Pose& pose) const {
    return {m.p_WB + m.R_WB * constants_.p_BM - (constants_.R_WT * (pose.p - pivot_) + pivot_),
            so3_log(constants_.R_WT * pose.R * constants_.R_MB * m.R_WB.transpose())};
  }

  void add_pose(const Layout& layout, const FittedMotion& current, const Pose& pose, FitEquations& equations) const {
    const double t = pose.t_s + constants_.time_offset_s;
    const Place at = place(t);
    const Motion m = current.at(t);
    const PoseError error = pose_error(m, pose);
    const Vec3 arm = m.R_WB * constants_.p_BM, omega_W = m.R_WB * m.omega_B;
    const double w_p = 1 / (sigma_p_ * sigma_p_), w_R = 1 / (sigma_R_ * sigma_R_);
    FitResidual p(error.position, w_p * robust_weight(w_p * error.position.squaredNorm()));
    FitResidual R(error.rotation, w_R * robust_weight(w_R * error.rotation.squaredNorm()));
    for (std::size_t i = 0; i < 4; ++i) {
      const int column = layout.knot[static_cast<std::size_t>(at.motion.piece) + i];
      p.add(column, at.weights.value[i] * Mat3::Identity());
      p.add(column + 3, -at.weights.value[i] * skew(arm));
      R.add(column + 3, -at.weights.value[i] * Mat3::Identity());
    }
    p.add(layout.tilt, skew(constants_.R_WT * (pose.p - pivot_)), 2);
    R.add(layout.tilt, Mat3::Identity(), 2);
    R.add(layout.mount, m.R_WB);
    p.add(layout.lever, m.R_WB);
    Mat3 by_time = Mat3::Zero();
    by_time.col(0) = m.v_WB + omega_W.cross(arm);
    p.add(layout.time_offset, by_time, 1);
    by_time.col(0) = -omega_W;
    R.add(layout.time_offset, by_time, 1);
    equations.add(p);
    equations.add(R);
  }

  /// What is known without measurements: biases stay about the same, constants are small.
  void add_expectations(const Layout& layout, FitEquations& equations) const {
    const Mat3 I = Mat3::Identity();
    const auto weight = [](double sigma) { return 1 / (sigma * sigma); };
    const double root = std::sqrt(settings_.bias_interval_s);
    for (std::size_t m = 0; m + 1 < bias_g_.size(); ++m) {
      FitResidual g(bias_g_[m + 1] - bias_g_[m] - walk_g_[m], weight(noise_.gyroscope_random_walk * root));
      g.add(layout.bias[m], -I);
      g.add(layout.bias[m + 1], I);
      equations.add(g);
      FitResidual a(bias_a_[m + 1] - bias_a_[m] - walk_a_[m], weight(noise_.accelerometer_random_walk * root));
      a.add(layout.bias[m] + 3, -I);
      a.add(layout.bias[m + 1] + 3, I);
      equations.add(a);
    }
    const auto constant = [&](int column, const Vec3& value, double sigma, int width) {
      FitResidual r(value, weight(sigma));
      r.add(column, I, width);
      equations.add(r);
    };
    constant(layout.bias[0], bias_g_[0], 0.2, 3);
    constant(layout.bias[0] + 3, bias_a_[0], 0.5, 3);
    constant(layout.tilt, so3_log(constants_.R_WT), settings_.tilt_sigma_rad, 2);
    constant(layout.mount, so3_log(constants_.R_MB), settings_.mount_sigma_rad, 3);
    constant(layout.lever, constants_.p_BM, settings_.lever_sigma_m, 3);
    constant(layout.time_offset, Vec3(constants_.time_offset_s, 0, 0), settings_.time_offset_sigma_s, 1);
    // The outermost knots are hardly seen: they stay where they are rather than nowhere.
    for (const int column : layout.knot) equations.damp(column, 6, 1e-2);
  }

  /// Returns the largest move of a knot, m or rad.
  double apply(const Layout& layout, const std::vector<double>& step) {
    double most = 0;
    for (std::size_t k = 0; k < p_.size(); ++k) {
      const Vec3 dp = segment(step, layout.knot[k]), turn_W = segment(step, layout.knot[k] + 3);
      p_[k] += dp;
      R_[k] = so3_normalised(so3_exp(turn_W) * R_[k]);
      most = std::max({most, dp.cwiseAbs().maxCoeff(), turn_W.cwiseAbs().maxCoeff()});
    }
    for (std::size_t m = 0; m < bias_g_.size(); ++m) {
      bias_g_[m] += segment(step, layout.bias[m]);
      bias_a_[m] += segment(step, layout.bias[m] + 3);
    }
    const auto value = [&](int column) { return step[static_cast<std::size_t>(column)]; };
    constants_.R_WT = so3_exp(Vec3(value(layout.tilt), value(layout.tilt + 1), 0)) * constants_.R_WT;
    constants_.R_MB = constants_.R_MB * so3_exp(segment(step, layout.mount));
    constants_.p_BM += segment(step, layout.lever);
    constants_.time_offset_s += value(layout.time_offset);
    return most;
  }

  FitSettings settings_;
  ImuNoise noise_;
  HostStamp begin_;
  double duration_s_ = 0, interval_s_ = 0, lead_s_ = 0;
  double sigma_w_ = 0, sigma_a_ = 0, sigma_p_ = 0, sigma_R_ = 0;
  std::vector<Reading> readings_;
  std::vector<Pose> poses_;     ///< with what was drawn, if anything
  std::vector<Pose> recorded_;  ///< without
  Vec3 pivot_ = Vec3::Zero();
  // the unknowns
  std::vector<Vec3> p_;
  std::vector<Mat3> R_;
  std::vector<Vec3> bias_g_, bias_a_;
  Constants constants_;
  std::vector<Vec3> walk_g_, walk_a_;  ///< expected changes of the biases: zero, or what was drawn
  std::size_t pieces_ = 0;
  int iterations_ = 0;
};

double range(const std::vector<Vec3>& values) {
  Vec3 low = values.front(), high = low;
  for (const Vec3& v : values) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  return (high - low).maxCoeff();
}

void Fitter::describe(FitReport& report) const {
  report.duration_s = duration_s_;
  report.knot_interval_s = interval_s_;
  report.iterations = iterations_;
  report.poses = recorded_.size();
  const FittedMotion current = motion();
  std::vector<double> position, rotation;
  std::size_t distrusted = 0;
  for (std::size_t i = 0; i < recorded_.size(); ++i) {
    if (i > 0) report.longest_gap_s = std::max(report.longest_gap_s, recorded_[i].t_s - recorded_[i - 1].t_s);
    const PoseError e = pose_error(current.at(recorded_[i].t_s + constants_.time_offset_s), recorded_[i]);
    position.push_back(e.position.norm());
    rotation.push_back(e.rotation.norm());
    if (std::min(robust_weight(e.position.squaredNorm() / (sigma_p_ * sigma_p_)),
                 robust_weight(e.rotation.squaredNorm() / (sigma_R_ * sigma_R_))) < 0.25)
      ++distrusted;
  }
  const double n = static_cast<double>(recorded_.size());
  const Summary positions = summarise(std::move(position)), rotations = summarise(std::move(rotation));
  report.position_rms_m = positions.rmse;
  report.rotation_rms_rad = rotations.rmse;
  report.position_p95_m = positions.p95;
  report.rotation_p95_rad = rotations.p95;
  report.distrusted_share = static_cast<double>(distrusted) / n;
  report.tilt_rad = so3_log(constants_.R_WT).norm();
  report.time_offset_s = constants_.time_offset_s;
  report.mount_rad = -so3_log(constants_.R_MB);
  report.p_BM = constants_.p_BM;
  report.gyroscope_bias = bias_g_[bias_g_.size() / 2];
  report.accelerometer_bias = bias_a_[bias_a_.size() / 2];
  report.gyroscope_bias_range = range(bias_g_);
  report.accelerometer_bias_range = range(bias_a_);
}

}  // namespace

Result<MotionFit> fit_motion(const std::vector<ImuSample>& imu, const ImuNoise& noise, const Trajectory& truth,
                             const FitSettings& settings) {
  const auto begin = std::chrono::steady_clock::now();
  if (const Status s = check_readings(imu, settings.imu_name); !s) return s.error();
  const auto poses = usable_poses(imu, truth, settings);
  if (!poses) return poses.error();
  Fitter fitter(within(imu, *poses), noise, *poses, settings);
  if (!fitter.run()) {
    return Error{ErrorKind::kRun, settings.truth_name, 0, "no motion fits this and " + settings.imu_name,
                 "IMU and ground truth of the same flight, body and clock"};
  }
  MotionFit fit{fitter.motion(), {}};
  fitter.describe(fit.report);
  fit.report.samples = sample_agreement(fit.motion, imu, noise);
  for (const double interval_s : {0.1, 0.5, 1.0, 2.0})
    fit.report.integrated.push_back(integrated_agreement(fit.motion, imu, noise, interval_s));
  fit.report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return fit;
}

}  // namespace epiline
