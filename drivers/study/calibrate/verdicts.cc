#include "drivers/study/calibrate/calibrate.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "drivers/study/calibrate/lens_columns.h"
#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// What flights need: the drifts of a track are about a tenth of a pixel, and the estimator finds the rest in flight
/// under a prior of 0.05 degrees and 0.5 mm (docs/derivations/calibration.md).
constexpr double kGoodLens_px = 0.2, kGoodRms_px = 0.8, kGoodCovered = 0.7, kGoodRotation = 0.1 * kDegree,
                 kGoodPlace_m = 3e-3, kGoodOffset_s = 1e-3, kGoodGain = 0.005;
/// No hardware is beyond these: scales are within 10 % in every data sheet, a module's three accelerometers within some
/// centimetres, and the worst noise of a MEMS chip, shaken by a hand, is a tenth of this.
constexpr double kMostGain = 0.1, kMostApart_m = 0.03, kMostGyroscopeDensity = 5e-3, kMostAccelerometerDensity = 5e-2;

constexpr int kJudgedX = 8, kJudgedY = 6;
constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};

struct LensError {
  double px;        ///< rms over the image
  double shape_px;  ///< what is in it because no lens of the model has this one's shape
};

/// How far pixels may be off over the image, apart from a turn of the camera, which its rotation on the IMU takes up.
LensError lens_error(const RigFit& fit) {
  const CameraParameters& lens = fit.state.constants.lens;
  const LensProjection projection(lens);
  const int columns = lens_columns(lens.model), all = columns + kLensTerms;
  Eigen::MatrixXd by_lens_all(0, all), by_turn(0, 3);
  for (int y = 0; y < kJudgedY; ++y) {
    for (int x = 0; x < kJudgedX; ++x) {
      const Vec2 px((x + 0.5) * lens.width / kJudgedX, (y + 0.5) * lens.height / kJudgedY);
      Vec3 f_C;
      Vec2 same;
      Mat23 by_point;
      LensJacobian J;
      if (!projection.camera().unproject(px, f_C) || !projection.project(f_C, same, by_point, J)) continue;
      const auto rows = by_turn.rows();
      by_lens_all.conservativeResize(rows + 2, Eigen::NoChange);
      by_turn.conservativeResize(rows + 2, Eigen::NoChange);
      by_lens_all.bottomRows<2>() << J, lens_terms(lens, px);
      by_turn.bottomRows<2>() = -by_point * skew(f_C);
    }
  }
  if (by_turn.rows() < 6) return {};
  const Mat3 information = by_turn.transpose() * by_turn;
  const Eigen::MatrixXd rest = by_lens_all - by_turn * information.inverse() * (by_turn.transpose() * by_lens_all);
  const auto rms = [&](double sum) { return std::sqrt(2 * sum / static_cast<double>(rest.rows())); };
  const Eigen::MatrixXd P = fit.uncertainty.covariance.topLeftCorner(columns, columns);
  const Eigen::MatrixXd& misfit = fit.uncertainty.misfit;
  const double by_numbers = (rest.leftCols(columns) * P * rest.leftCols(columns).transpose()).trace();
  if (misfit.cols() == 0) return {rms(by_numbers), 0};
  Eigen::MatrixXd of_lens(all, misfit.cols());
  of_lens << misfit.topRows(columns), misfit.bottomRows<kLensTerms>();
  const double by_shape = (rest * of_lens).squaredNorm();
  return {rms(by_numbers + by_shape), rms(by_shape)};
}

/// Parts of the image with at least ten corners.
std::array<int, kJudgedX * kJudgedY> corners_by_part(const RigFit& fit) {
  const CameraParameters& lens = fit.state.constants.lens;
  std::array<int, kJudgedX * kJudgedY> counts{};
  for (const CornerError& corner : fit.corners) {
    const int x = std::clamp(static_cast<int>(kJudgedX * corner.px.x() / lens.width), 0, kJudgedX - 1);
    const int y = std::clamp(static_cast<int>(kJudgedY * corner.px.y() / lens.height), 0, kJudgedY - 1);
    ++counts[static_cast<std::size_t>(kJudgedX * y + x)];
  }
  return counts;
}

std::string empty_corner(const std::array<int, kJudgedX * kJudgedY>& counts) {
  const auto count = [&](int from_x, int from_y) {
    int sum = 0;
    for (int y = from_y; y < from_y + kJudgedY / 2; ++y)
      for (int x = from_x; x < from_x + kJudgedX / 2; ++x)
        sum += counts[static_cast<std::size_t>(kJudgedX * y + x)] >= 10;
    return sum;
  };
  const std::array<int, 4> seen = {count(0, 0), count(kJudgedX / 2, 0), count(0, kJudgedY / 2),
                                   count(kJudgedX / 2, kJudgedY / 2)};
  static constexpr std::array<const char*, 4> kNames = {"upper left", "upper right", "lower left", "lower right"};
  return kNames[static_cast<std::size_t>(std::min_element(seen.begin(), seen.end()) - seen.begin())];
}

/// The axis of the IMU about which the rig turned least.
const char* least_turned(const RigFit& fit) {
  const FittedMotion motion = fit.state.motion();
  Vec3 sum = Vec3::Zero();
  for (double t = 0; t < fit.state.duration_s; t += 0.05) sum += motion.at(t).omega_B.cwiseAbs2();
  int axis = 0;
  sum.minCoeff(&axis);
  return kAxes[static_cast<std::size_t>(axis)];
}

Verdict verdict(bool good, const char* what, std::string found, std::string advice) {
  return {good, what, std::move(found), good ? "" : std::move(advice)};
}

/// The accelerometer knows metres, and the board's file says some.
Verdict board_verdict(const RigFit& fit) {
  const double percent = 100 * (std::exp(fit.board_size) - 1), sigma = 100 * fit.board_size_sigma;
  if (fit.is_board_as_described())
    return {true, "board",
            fmt::format("as large as its file says: by the accelerometer {:+.1f} %, good to {:.1f} %", percent, sigma),
            ""};
  return {false, "board",
          fmt::format("{:.1f} +- {:.1f} % {} than its file says, by the accelerometer; the lengths below are by the "
                      "accelerometer too",
                      std::abs(percent), sigma, percent > 0 ? "larger" : "smaller"),
          "measure a tag or a square of the board and correct the size in its file; if it is right, the "
          "accelerometer's range"};
}

Verdict lens_verdict(const Calibration& c, const LensError& error) {
  const RigFit& fit = c.fit;
  const CameraParameters& lens = c.camera.parameters;
  const auto& [fx, fy, cx, cy] = lens.intrinsics;
  std::string found = fmt::format(
      "{}, focal length {:.2f} {:.2f} +- {:.2f} px, centre {:.2f} {:.2f} +- {:.2f} px; good to {:.2f} px over the "
      "image",
      name_of(lens.model), fx, fy, std::max(fit.sigma(0), fit.sigma(1)), cx, cy, std::max(fit.sigma(2), fit.sigma(3)),
      error.px);
  if (error.shape_px > 0)
    found += fmt::format(", {:.2f} px of it because no lens of this model has the true shape", error.shape_px);
  return verdict(error.px<kGoodLens_px, "lens", std::move(found), 2 * error.shape_px> error.px
                     ? "another model (--model), or images that the board fills to their edges"
                     : "tilt the board by 30 to 45 degrees in all directions, and fill the image with it");
}

}  // namespace

void judge(Calibration& c) {
  const RigFit& fit = c.fit;
  const RigColumns columns(0, c.camera.parameters.model);
  const auto counts = corners_by_part(fit);
  const LensError error = lens_error(fit);
  c.lens_px = error.px;
  c.covered = static_cast<double>(std::count_if(counts.begin(), counts.end(), [](int n) { return n >= 10; })) /
              static_cast<double>(counts.size());
  const std::string turn_more =
      fmt::format("turn the rig more and faster, about the IMU's {} axis most", least_turned(fit));
  c.verdicts = {
      verdict(fit.rms_px < kGoodRms_px, "corners",
              fmt::format("{} in {} images, rms {:.3f} px, {} left out", fit.corners.size(), fit.views, fit.rms_px,
                          fit.outliers),
              "a flat board, sharp images (more light, shorter exposure), the board's true size"),
      board_verdict(fit),
      verdict(c.covered >= kGoodCovered, "image", fmt::format("{:.0f} % of it saw the board", 100 * c.covered),
              fmt::format("bring the board into the {} corner of the image", empty_corner(counts))),
      lens_verdict(c, error),
      verdict(fit.sigmas(columns.R_BC).maxCoeff() < kGoodRotation, "rotation",
              fmt::format("of the camera on the IMU, good to {:.3f} degrees",
                          fit.sigmas(columns.R_BC).maxCoeff() / kDegree),
              turn_more),
      verdict(
          fit.sigmas(columns.p_BC).maxCoeff() < kGoodPlace_m, "place",
          fmt::format("of the camera on the IMU: {:.1f} {:.1f} {:.1f} mm, good to {:.1f} mm", 1e3 * c.camera.p_BC.x(),
                      1e3 * c.camera.p_BC.y(), 1e3 * c.camera.p_BC.z(), 1e3 * fit.sigmas(columns.p_BC).maxCoeff()),
          turn_more),
      verdict(fit.sigma(columns.time_offset) < kGoodOffset_s, "time offset",
              fmt::format("{:+.2f} ms, good to {:.2f} ms (time of the IMU = stamp of the image + offset)",
                          1e3 * c.camera.time_offset_s, 1e3 * fit.sigma(columns.time_offset)),
              turn_more),
      verdict(fit.noise.gyroscope_density < kMostGyroscopeDensity &&
                  fit.noise.accelerometer_density < kMostAccelerometerDensity,
              "IMU noise",
              fmt::format("gyroscope {:.2e} rad/s/sqrt(Hz), accelerometer {:.2e} m/s^2/sqrt(Hz), with what shook the "
                          "hand that held it",
                          fit.noise.gyroscope_density, fit.noise.accelerometer_density),
              "readings in SI units, with times of one clock: no IMU has such noise"),
  };
  const auto gain = [&](const char* what, const Vec3& value, int column) {
    const Vec3 off = 100 * (value - Vec3::Ones());
    const double most = std::min(kGoodGain + 3 * fit.sigmas(column).maxCoeff(), kMostGain);
    const bool right = ((value - Vec3::Ones()).cwiseAbs().array() < most).all();
    return verdict(right, what,
                   fmt::format("{:+.2f} {:+.2f} {:+.2f} % to be added, good to {:.2f} %", off.x(), off.y(), off.z(),
                               100 * fit.sigmas(column).maxCoeff()),
                   "a range that is set right, and readings in SI units: the estimator does not correct a scale");
  };
  const auto apart_mm = [&](int axis) { return 1e3 * fit.state.constants.accelerometers_B.col(axis).norm(); };
  c.verdicts.push_back(
      verdict(std::max({apart_mm(0), apart_mm(1), apart_mm(2)}) < 1e3 * kMostApart_m, "accelerometers",
              fmt::format("those of x, y and z are {:.1f} {:.1f} {:.1f} mm from their middle, good to {:.1f} mm",
                          apart_mm(0), apart_mm(1), apart_mm(2),
                          1e3 * std::max(fit.sigmas(columns.accelerometer_y).maxCoeff(),
                                         fit.sigmas(columns.accelerometer_z).maxCoeff())),
              "the board's size, and readings of one IMU: no module is so large"));
  c.verdicts.push_back(gain("gyroscope scale", fit.state.constants.gyroscope_gain, columns.gyroscope_gain));
  c.verdicts.push_back(gain("accelerometer scale", fit.state.constants.accelerometer_gain, columns.accelerometer_gain));
}

}  // namespace epiline
