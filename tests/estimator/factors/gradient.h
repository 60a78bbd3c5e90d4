#pragma once
// The right-hand side of a factor against the slope of its own cost, and what the factor leaves open.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "estimator/factors/prior.h"
#include "estimator/factors/track.h"
#include "estimator/solver/marginalise.h"
#include "tests/estimator/factors/named_blocks.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/height_readings.h"
#include "tests/estimator/slope.h"
#include "tests/estimator/synthetic_window.h"
#include "tests/estimator/wheel_readings.h"

namespace epiline::test {

/// A factor as a function of the window. Its cost is that of residuals in sigmas.
struct Subject {
  std::string name;
  std::function<double(const Window&, NormalEquations*)> cost;
  double step;                  ///< of the differences, in sigmas of the unknown
  bool velocity_biases = true;  ///< has columns of them
};

inline Subject visual(const std::string& name, const Window& w, std::shared_ptr<VisualFactorModel> factor, double step,
                      TrackNoiseModel noise = TrackNoiseModel::kWhite, bool rows = false) {
  VisualSettings settings = smooth_settings();
  settings.noise = noise;
  settings.rows = rows;
  settings.drift_sigma = 0.25;  // so small that the views show each depth
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

inline std::vector<std::string> on_every_set(const std::vector<std::string>& vectorised,
                                             std::vector<std::string> others = {}) {
  for (const std::string& name : vectorised)
    for (const InstructionSet set : kInstructionSets) others.push_back(name + "_" + name_of(set));
  return others;
}

/// All there is to a window: rest, wheels, heights, and a prior that a frame left behind.
inline SyntheticWindow furnished_window(double readout_s = 0, bool second = false, bool fisheye = false) {
  SyntheticWindow s = make_window(
      {.readout_s = readout_s, .second = second, .second_later = 0.3 * readout_s, .alone = second, .fisheye = fisheye});
  Window& w = *s.window;
  CalibrationTangent sigmas;
  sigmas << 5e-3, Vec3::Constant(0.01), Vec3::Constant(0.01), 0.01, 0.01, 0.01, 0.01;
  set_initial_prior(w, {}, sigmas);
  TrackFactor factor(best_instruction_set());
  factor.collect(w, smooth_settings());
  Marginaliser(best_instruction_set()).marginalise_oldest(w, factor, smooth_settings());
  w.calibration.time_offset = 2e-3;
  w.calibration.focal = 0.01;
  w.calibration.shape = 0.002;
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
  for (CalibrationPart* part : p.parts()) part->sigma = 3e-3;
  return s;
}

/// All unknowns. The error is relative to the right-hand side or, if that is larger, to the square root of the
/// curvature: the right-hand side of a residual of one sigma. Reached: 1e-9, and 4e-8 with Huber's kernels for their
/// small step.
inline void check_gradient(const Subject& subject, Window& w, double tolerance = 1e-7) {
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
inline void check_gauge(const Subject& subject, const Window& w) {
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

}  // namespace epiline::test
