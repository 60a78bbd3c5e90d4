// The right-hand side of every factor against the slope of its own cost, on every instruction set of this machine; and
// that no factor but a prior sees the position and the heading of the whole.
// Derivations: docs/derivations/track.md, docs/derivations/drift.md, docs/derivations/epipolar.md,
// docs/derivations/reprojection.md, docs/derivations/calibration.md, docs/derivations/imu.md,
// docs/derivations/wheel.md, docs/derivations/height.md, docs/derivations/zero_motion.md,
// docs/derivations/marginalisation.md, docs/derivations/several_cameras.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "estimator/factors/calibration_prior.h"
#include "estimator/factors/epipolar.h"
#include "estimator/factors/height.h"
#include "estimator/factors/imu.h"
#include "estimator/factors/prior.h"
#include "estimator/factors/reprojection.h"
#include "estimator/factors/track.h"
#include "estimator/factors/wheel.h"
#include "estimator/factors/zero_motion.h"
#include "estimator/solver/marginalise.h"
#include "tests/estimator/factors/named_blocks.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/height_readings.h"
#include "tests/estimator/slope.h"
#include "tests/estimator/synthetic_window.h"
#include "tests/estimator/wheel_readings.h"

namespace epiline::test {
namespace {

/// A factor as a function of the window. Its cost is that of residuals in sigmas.
struct Subject {
  std::string name;
  std::function<double(const Window&, NormalEquations*)> cost;
  double step;                  ///< of the differences, in sigmas of the unknown
  bool velocity_biases = true;  ///< has columns of them
};

/// Reprojection with its depths converged, as the points of the track factor are.
class ConvergedReprojection final : public VisualFactorModel {
 public:
  explicit ConvergedReprojection(InstructionSet set) : factor_(set) {}
  void collect(const Window& w, const VisualSettings& s) noexcept override { factor_.collect(w, s); }
  void linearise(const Window& w, VisualSystem& out) noexcept override {
    for (int i = 0; i < 40; ++i) {
      factor_.linearise(w, out);
      factor_.step(w);  // no camera moves: the depths alone
    }
    factor_.linearise(w, out);
  }
  double cost(const Window& w) noexcept override { return factor_.cost(w); }
  void marginalise_oldest(const Window&, const VisualSettings&, VisualSystem&) noexcept override {}

 private:
  ReprojectionFactor factor_;
};

/// Differences so small that no residual crosses the corner of Huber's kernel, where the slope bends.
constexpr double kWithinACorner = 1e-4;

Subject visual(const std::string& name, const Window& w, std::shared_ptr<VisualFactorModel> factor, double step,
               TrackNoiseModel noise = TrackNoiseModel::kWhite, bool rows = false) {
  VisualSettings settings = smooth_settings();
  settings.noise = noise;
  settings.rows = rows;
  settings.drift_sigma = 0.5;
  factor->collect(w, settings);
  const auto system = std::make_shared<VisualSystem>();
  return {name,
          [factor, system](const Window& at, NormalEquations* out) {
            factor->linearise(at, *system);
            if (out) add_visual(at, *system, at.size(), *out);
            return system->cost;
          },
          step, false};
}

std::vector<std::string> on_every_set(const std::vector<std::string>& vectorised,
                                      std::vector<std::string> others = {}) {
  for (const std::string& name : vectorised)
    for (const InstructionSet set : kInstructionSets) others.push_back(name + "_" + name_of(set));
  return others;
}

/// All there is to a window: rest, wheels, heights, and a prior that a frame left behind.
SyntheticWindow furnished_window(double readout_s = 0, bool second = false) {
  SyntheticWindow s =
      make_window({.readout_s = readout_s, .second = second, .second_later = 0.3 * readout_s, .alone = second});
  Window& w = *s.window;
  CalibrationTangent sigmas;
  sigmas << 5e-3, Vec3::Constant(0.01), Vec3::Constant(0.01), 0.01, 0.01, 0.01;
  set_initial_prior(w, {}, sigmas);
  TrackFactor factor(best_instruction_set());
  factor.collect(w, smooth_settings());
  Marginaliser(best_instruction_set()).marginalise_oldest(w, factor, smooth_settings());
  w.calibration.time_offset = 2e-3;
  w.calibration.focal = 0.01;
  w.calibration.scale = {0.004, -0.003};
  for (int k = 0; k < w.size(); ++k) {
    Slot& slot = w.at(k);
    slot.x.p += Vec3(1e-3, -2e-3, 5e-4) * std::sin(k);  // off the prior's centre
    slot.at_rest = k % 3 != 2;
    slot.rest_link = k > 0 ? w.at(k / 2).id : 0;
  }
  furnish_wheels(w);
  furnish_heights(w);
  CalibrationPrior& p = w.calibration_prior;
  for (CalibrationPart* part : {&p.rotation, &p.translation, &p.focal, &p.accelerometer_scale, &p.gyroscope_scale})
    part->sigma = 3e-3;
  return s;
}

class Gradient : public testing::TestWithParam<std::string> {
 protected:
  /// Without a cost: not on this machine.
  Subject make(const Window& w) {
    const std::string& name = GetParam();
    if (name == "prior") return {name, add_prior, 1};
    const auto of = [&](auto add, double step, bool velocity_biases) {
      return Subject{name,
                     [add](const Window& at, NormalEquations* out) {
                       return add(at, {at.size(), false}, out);
                     },
                     step, velocity_biases};
    };
    if (name == "calibration_prior") return of(add_calibration_prior, 0.01, false);
    if (name == "wheel") return of(add_wheel, 0.01, false);
    if (name == "height") return of(add_height, 0.01, false);
    if (name == "zero_motion") return of(add_zero_motion, 1, true);
    for (const InstructionSet set : kInstructionSets) {
      if (!runs_here(set) || !name.ends_with(std::string("_") + name_of(set))) continue;
      if (name.starts_with("imu"))
        return {name,
                [set](const Window& at, NormalEquations* out) {
                  return add_imu(at, {at.size(), false}, factor_kernels(set), out);
                },
                1};
      if (name.starts_with("epipolar")) return visual(name, w, std::make_shared<EpipolarFactor>(set), kWithinACorner);
      if (name.starts_with("reprojection"))
        return visual(name, w, std::make_shared<ConvergedReprojection>(set), kWithinACorner);
      return visual(name, w, std::make_shared<TrackFactor>(set), 0.02,
                    name.starts_with("drift") ? TrackNoiseModel::kDrift : TrackNoiseModel::kWhite,
                    name.find("_rows_") != std::string::npos);
    }
    return {};
  }
};

/// All unknowns. The error is relative to the right-hand side or, if that is larger, to the square root of the
/// curvature: the right-hand side of a residual of one sigma. Reached: 1e-9, and 4e-8 with Huber's kernels for their
/// small step.
void check_gradient(const Subject& subject, Window& w, double tolerance = 1e-7) {
  NamedBlocks at;
  const double cost = subject.cost(w, &at);
  EXPECT_FALSE(at.b.empty()) << "it says nothing";
  EXPECT_NEAR(subject.cost(w, nullptr), cost, 1e-9 * (1 + std::abs(cost)));
  const auto check = [&](Unknown a, int i, const std::function<void(double)>& move, const std::string& what) {
    const auto cost_at = [&](double d) {
      move(d);
      return subject.cost(w, nullptr);
    };
    const double sigma = 1 / std::sqrt(at.curvature(a, i));
    if (!std::isfinite(sigma)) {  // says nothing of it
      EXPECT_EQ(at.slope(a, i), 0) << what;
      EXPECT_NEAR(cost_at(1e-3), cost, 1e-9 * (1 + std::abs(cost))) << what;
      return;
    }
    const double expected = -0.5 * slope(cost_at, subject.step * sigma);  // cost = r'r, b = -J'r
    const double error = std::abs(at.slope(a, i) - expected) / std::max(std::abs(expected), 1 / sigma);
    EXPECT_LT(error, tolerance) << what << ": " << at.slope(a, i) << " for " << expected;
  };
  for (int k = 0; k < w.size(); ++k) {
    const NavState keep = w.at(k).x;
    const std::string frame = "frame " + std::to_string(k) + ", ";
    for (int i = 0; i < 6; ++i)
      check(
          pose_of(k), i,
          [&](double d) {
            w.at(k).x = keep;
            retract_pose(w.at(k).x, d * Vec6::Unit(i));
          },
          frame + "pose " + std::to_string(i));
    for (int i = 0; i < 9 && subject.velocity_biases; ++i)
      check(
          velocity_biases_of(k), i,
          [&](double d) {
            w.at(k).x = keep;
            retract_velocity_biases(w.at(k).x, d * Vec9::Unit(i));
          },
          frame + "velocity and biases " + std::to_string(i));
    w.at(k).x = keep;
  }
  const Calibration keep = w.calibration;
  for (int i = 0; i < kCalibration; ++i)
    check(
        calibration_of_camera(), i,
        [&](double d) {
          w.calibration = keep;
          retract(w.calibration, d * CalibrationTangent::Unit(i));
        },
        "calibration " + std::to_string(i));
  w.calibration = keep;
}

/// To shift everything, or to turn it about the vertical, has neither slope nor curvature.
void check_gauge(const Subject& subject, const Window& w) {
  NamedBlocks at;
  subject.cost(w, &at);
  using Numbers = Eigen::Matrix<double, NamedBlocks::kMost, 1>;
  for (int direction = 0; direction < 4; ++direction) {
    std::map<int, Numbers> moved{{NamedBlocks::key(calibration_of_camera()), Numbers::Zero()}};
    for (int k = 0; k < w.size(); ++k) {
      const NavState& x = w.at(k).x;
      Numbers pose = Numbers::Zero(), velocity = Numbers::Zero();
      if (direction < 3) {
        pose[direction] = 1;
      } else {
        pose.head<6>() << Vec3::UnitZ().cross(x.p), x.R.transpose() * Vec3::UnitZ();
        velocity.head<3>() = Vec3::UnitZ().cross(x.v);
      }
      moved[NamedBlocks::key(pose_of(k))] = pose;
      moved[NamedBlocks::key(velocity_biases_of(k))] = velocity;
    }
    double slope = 0, slopes = 0, curvature = 0, curvatures = 0;
    for (const auto& [key, b] : at.b) {
      slope += Numbers::Map(b.data()).dot(moved[key]);
      slopes += Numbers::Map(b.data()).norm() * moved[key].norm();
    }
    for (const auto& [keys, H] : at.H) {
      const Eigen::Map<const Eigen::Matrix<double, NamedBlocks::kMost, NamedBlocks::kMost, Eigen::RowMajor>> block(
          H.data());
      const Numbers &a = moved[keys.first], &b = moved[keys.second];
      curvature += keys.first == keys.second ? a.dot(block.selfadjointView<Eigen::Upper>() * b) : 2 * a.dot(block * b);
      curvatures += a.norm() * block.norm() * b.norm();
    }
    EXPECT_LE(std::abs(slope), 1e-6 * slopes) << "direction " << direction;
    EXPECT_LE(std::abs(curvature), 1e-9 * curvatures) << "direction " << direction;
  }
}

TEST_P(Gradient, IsTheSlopeOfTheCostAndLeavesPositionAndYawOpen) {
  const bool rows = GetParam().find("_rows_") != std::string::npos;
  const bool second = GetParam().find("_second_") != std::string::npos;
  SyntheticWindow s = furnished_window(rows ? 0.05 : 0, second);
  const Subject subject = make(*s.window);
  if (!subject.cost) GTEST_SKIP() << "not on this machine";
  check_gradient(subject, *s.window);
  // else the newest view would move with its velocity, of which its factor takes no slope
  s.window->calibration.time_offset = 0;
  // a prior knows where the window is; zero motion is a difference along the world's axes, which turn with everything
  if (GetParam() != "prior" && GetParam() != "zero_motion") check_gauge(subject, *s.window);
}

/// Where two rays pass each other.
Vec3 nearest_point(const Window& w, const TrackRecord& t, int i, int j) {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  for (const int k : {i, j}) {
    const NavState& x = w.at(k).x;
    const Vec3 f = x.R * w.calibration.R_BC * bearing_of(w.view(t, k));
    const Mat3 across = Mat3::Identity() - f * f.transpose();
    A += across;
    b += across * (x.p + x.R * w.calibration.p_BC);
  }
  return A.inverse() * b;
}

class HeldDepth : public Gradient {};

/// The last camera all but touches the point it sees: a hundredth of the first one's distance is left. There the
/// depth along the bearing is held, and has no slope.
TEST_P(HeldDepth, HasNoSlope) {
  SyntheticWindow s = make_window({.frames = 6, .tracks = 12, .state_error = 0});
  Window& w = *s.window;
  const int last = w.size() - 1;
  int chosen = 0;
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (w.seen(t, 0) && w.seen(t, last - 1) && w.seen(t, last)) chosen = i;
    w.track(i).in_use = false;
  }
  TrackRecord& t = w.track(chosen);
  t.in_use = true;
  const Vec3 P = nearest_point(w, t, 0, last - 1);
  NavState& x = w.at(last).x;
  const Vec3 f = x.R * w.calibration.R_BC * bearing_of(w.view(t, last));
  const double distance = (P - w.at(0).x.p).norm();
  x.p = P - distance * (0.01 * f + 0.0005 * f.unitOrthogonal()) - x.R * w.calibration.p_BC;
  const Subject subject = make(w);
  if (!subject.cost) GTEST_SKIP() << "not on this machine";
  const auto slope_along = [&](const Vec3& direction) {
    const Vec3 keep = x.p;
    const double found = slope(
        [&](double d) {
          x.p = keep + d * direction;
          return subject.cost(w, nullptr);
        },
        1e-4);
    x.p = keep;
    return found;
  };
  ASSERT_LT(std::abs(slope_along(f)), 1e-6 * std::abs(slope_along(f.unitOrthogonal()))) << "it is not held";
  // A depth that is held depends on the scale of the homogeneous point, which the elimination takes for free: 2e-5 to
  // 6e-5 in two draws of the window. With a slope it would be 3e-4.
  check_gradient(subject, w, 1e-4);
}

const auto name_of_subject = [](const testing::TestParamInfo<std::string>& test) { return test.param; };
INSTANTIATE_TEST_SUITE_P(Factors, Gradient,
                         testing::ValuesIn(on_every_set({"track", "drift", "drift_second", "track_rows", "drift_rows",
                                                         "drift_second_rows", "epipolar", "reprojection", "imu"},
                                                        {"prior", "calibration_prior", "wheel", "height",
                                                         "zero_motion"})),
                         name_of_subject);
INSTANTIATE_TEST_SUITE_P(Factors, HeldDepth, testing::ValuesIn(on_every_set({"track"})), name_of_subject);

}  // namespace
}  // namespace epiline::test
