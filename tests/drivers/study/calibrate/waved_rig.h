#pragma once
// A rig that is waved before a board, made without the fit's splines: sines, and an IMU by its error model.
#include <cmath>
#include <cstdint>
#include <vector>

#include "drivers/flights/motion/motion.h"
#include "drivers/laboratory/simulate/imu_model.h"
#include "drivers/study/calibrate/board.h"
#include "estimator/geometry/camera.h"
#include "estimator/geometry/so3.h"

namespace epiline {

inline CameraParameters lens_of(CameraModel model) {
  switch (model) {
    case CameraModel::kPinholeRadialTangential:
      return {model, 752, 480, {458.6, 457.3, 367.2, 248.4}, {-0.283, 0.074, 2e-4, 2e-5}};
    case CameraModel::kPinholeEquidistant:
      return {model, 640, 480, {250.2, 249.8, 325.0, 238.5}, {-0.012, 0.021, -0.02, 0.006}};
    case CameraModel::kDoubleSphere:
      return {model, 640, 512, {160.1, 160.3, 318.2, 258.9}, {-0.2, 0.59}};
    case CameraModel::kUnified:
      break;
  }
  return {};
}

/// Where WavedRig looks: tags as Kalibr's example board has them.
inline AprilGrid waved_grid() { return {4, 4, 0.088, 0.3}; }

struct WavedRig {
  CameraParameters lens = lens_of(CameraModel::kPinholeRadialTangential);
  Mat3 R_BC = so3_exp(Vec3(0.02, -0.03, 1.55));
  Vec3 p_BC = {-0.021, -0.065, 0.010};
  double time_offset_s = 0.0123;  ///< t_IMU = t_image + time_offset
  double seconds = 20, image_rate_hz = 20;
  double corner_px = 0.15;
  ImuModel imu;
  std::uint64_t seed = 1;
  Mat3 accelerometers_B = Mat3::Zero();  ///< column i: where the accelerometer of axis i is, m
  double bend_m = 0;                     ///< of the board from its middle to its corners
  double turns = 1;                      ///< how much it is turned; 0: not at all

  /// The board's gravity: it hangs on a wall, not quite upright.
  Vec3 g_T() const { return 9.81 * Vec3(0.05, -0.98, -0.12).normalized(); }

  struct Pose {
    Mat3 R_TB;
    Vec3 p_TB;
  };
  Pose pose(double t) const {
    const double phase = 0.37 * static_cast<double>(seed);
    const auto wave = [&](double hz, double shift) { return std::sin(6.283185307 * hz * t + shift + phase); };
    const Vec3 turn =
        turns * Vec3(0.35 * wave(0.53, 0) + 0.12 * wave(1.3, 1), 0.4 * wave(0.41, 2) + 0.1 * wave(1.1, 0.3),
                     0.5 * wave(0.31, 4) + 0.1 * wave(0.9, 2));
    const Mat3 R_TC = Vec3(1, -1, -1).asDiagonal() * so3_exp(turn);
    const Vec3 middle(0.22, 0.22, 0);
    const double distance = distance_m * (1 + 0.25 * wave(0.23, 1.5));
    const Vec3 p_TC = middle + 0.08 * Vec3(wave(0.7, 0.2), wave(0.6, 3.1), wave(0.8, 5)) - distance * R_TC.col(2);
    const Mat3 R_TB = R_TC * R_BC.transpose();
    return {R_TB, p_TC - R_TB * p_BC};
  }
  double distance_m = 0.55;

  /// In a world whose gravity points down its z axis.
  Motion motion(double t) const {
    const Vec3 down_T = g_T().normalized(), axis = down_T.cross(Vec3(0, 0, -1));
    const Mat3 R_WT = so3_exp(axis.normalized() * std::atan2(axis.norm(), -down_T.z()));
    constexpr double kStep = 1e-3;
    const Pose before = pose(t - kStep), now = pose(t), after = pose(t + kStep);
    Motion m;
    m.R_WB = R_WT * now.R_TB;
    m.p_WB = R_WT * now.p_TB;
    m.v_WB = R_WT * (after.p_TB - before.p_TB) / (2 * kStep);
    m.a_WB = R_WT * (after.p_TB - 2 * now.p_TB + before.p_TB) / (kStep * kStep);
    m.omega_B = so3_log(before.R_TB.transpose() * after.R_TB) / (2 * kStep);
    return m;
  }

  /// As an IMU at the origin would have to move to measure what the accelerometers do.
  Motion felt(double t) const {
    constexpr double kStep = 1e-3;
    Motion m = motion(t);
    const Vec3 alpha_B = (motion(t + kStep).omega_B - motion(t - kStep).omega_B) / (2 * kStep);
    Vec3 more_B;
    for (int i = 0; i < 3; ++i) {
      const Vec3 p_B = accelerometers_B.col(i);
      more_B[i] = (alpha_B.cross(p_B) + m.omega_B.cross(m.omega_B.cross(p_B)))[i];
    }
    m.a_WB += m.R_WB * more_B;
    return m;
  }

  std::vector<ImuSample> readings() const {
    ImuSimulator simulator(imu, Random(seed, 7));
    std::vector<ImuSample> samples;
    const double period = 1 / imu.rate_hz;
    for (int i = 0; i * period < seconds; ++i)
      samples.push_back(simulator.read(kBegin + Span::from_seconds(i * period), felt(i * period)));
    return samples;
  }

  std::vector<CornerView> views() const {
    const Camera camera(lens);
    const Target target = waved_grid().target();
    Random noise(seed, 8);
    std::vector<CornerView> list;
    for (double t = 0.3; t < seconds - 0.3; t += 1 / image_rate_hz) {
      const Pose at = pose(t);
      const Mat3 R_CT = (at.R_TB * R_BC).transpose();
      CornerView view{kBegin + Span::from_seconds(t - time_offset_s), {}};
      for (const auto& [id, p_T] : target) {
        Vec2 px;
        const Vec3 bend(0, 0, bend_m * (p_T.head<2>() - Vec2(0.22, 0.22)).squaredNorm() / 0.1);
        const Vec3 p_C = R_CT * (p_T + bend - at.p_TB - at.R_TB * p_BC);
        if (!camera.project(p_C, px) || px.x() < 2 || px.y() < 2 || px.x() > lens.width - 3 || px.y() > lens.height - 3)
          continue;
        px += corner_px * noise.normal3(1).head<2>();
        view.corners.push_back({id, p_T, px});
      }
      list.push_back(std::move(view));
    }
    return list;
  }

  static constexpr HostStamp kBegin{1'000'000'000'000};
};

}  // namespace epiline
