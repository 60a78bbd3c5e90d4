#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <vector>

#include "drivers/study/calibrate/calibration_files.h"
#include "drivers/study/calibrate/lens_columns.h"
#include "drivers/study/report/page.h"
#include "drivers/study/report/svg_plot.h"
#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr double kInDegrees = 180 / std::numbers::pi;
constexpr int kPartsX = 12, kPartsY = 8;

std::string verdict_rows(const Calibration& c) {
  std::vector<HtmlRow> rows;
  for (const Verdict& v : c.verdicts) rows.push_back({v.what, v.good ? "good" : "<b>poor</b>", v.found, v.advice});
  return html_table({"", "", "found", "what to do"}, rows, true);
}

/// A figure with its sigma and how far it is from the guess, all times `scale` and with `digits` behind the point.
HtmlRow figure_row(const std::string& what, double value, double sigma, std::optional<double> off, double scale,
                   int digits, const char* unit) {
  return {what, fmt::format("{:.{}f}", scale * value, digits), fmt::format("{:.{}f}", scale * sigma, digits), unit,
          off ? fmt::format("{:+.{}f}", scale * *off, digits) : ""};
}

std::string figure_rows(const Calibration& c) {
  const CameraParameters& lens = c.camera.parameters;
  const RigColumns columns(0, lens.model);
  std::vector<HtmlRow> rows;
  const auto minus = [&](auto value) { return c.guess ? std::optional<double>(value(*c.guess)) : std::nullopt; };
  const LensStep values = lens_values(lens);
  const bool same_model = c.guess && c.guess->parameters.model == lens.model;
  for (int i = 0; i < values.size(); ++i) {
    std::optional<double> off;
    if (same_model) off = values[i] - lens_values(c.guess->parameters)[i];
    rows.push_back(figure_row(lens_column_name(lens.model, i), values[i], c.fit.sigma(i), off, 1, i < 4 ? 3 : 6,
                              i < 4 ? "px" : ""));
  }
  static constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    const auto off = minus([&](const CameraCalibration& g) { return so3_log(g.R_BC.transpose() * c.camera.R_BC)[i]; });
    rows.push_back(figure_row(fmt::format("rotation of the camera on the IMU, {}", kAxes[static_cast<std::size_t>(i)]),
                              so3_log(c.camera.R_BC)[i], c.fit.sigma(columns.R_BC + i), off, kInDegrees, 3, "degrees"));
  }
  for (int i = 0; i < 3; ++i) {
    const auto off = minus([&](const CameraCalibration& g) { return c.camera.p_BC[i] - g.p_BC[i]; });
    rows.push_back(figure_row(fmt::format("place of the camera on the IMU, {}", kAxes[static_cast<std::size_t>(i)]),
                              c.camera.p_BC[i], c.fit.sigma(columns.p_BC + i), off, 1e3, 2, "mm"));
  }
  const auto late = minus([&](const CameraCalibration& g) { return c.camera.time_offset_s - g.time_offset_s; });
  rows.push_back(
      figure_row("time offset", c.camera.time_offset_s, c.fit.sigma(columns.time_offset), late, 1e3, 3, "ms"));
  return html_table({"", "value", "± sigma", "unit", "minus the guess"}, rows);
}

struct ImagePart {
  Vec2 sum_px = Vec2::Zero(), sum_e = Vec2::Zero();
  int count = 0;
};

/// Mean errors over the image, as lines: what a lens model cannot follow shows as a pattern.
std::string error_map(const Calibration& c) {
  const CameraParameters& lens = c.camera.parameters;
  std::map<int, ImagePart> parts;
  for (const CornerError& corner : c.fit.corners) {
    const int x = static_cast<int>(kPartsX * corner.px.x() / lens.width),
              y = static_cast<int>(kPartsY * corner.px.y() / lens.height);
    ImagePart& part = parts[kPartsX * y + x];
    part.sum_px += corner.px;
    part.sum_e += corner.e_px;
    ++part.count;
  }
  double most = 1e-9;
  for (const auto& [cell, part] : parts) most = std::max(most, (part.sum_e / part.count).norm());
  const double magnified = 0.8 * lens.width / kPartsX / most;
  Plot plot{.x_label = fmt::format("column, px; the longest line is an error of {:.3f} px", most),
            .y_label = "row, px, upwards",
            .equal_axes = true};
  const double right = lens.width, lowest = -lens.height;
  plot.lines.push_back({"", "truth", {0, right, right, 0, 0}, {0, 0, lowest, lowest, 0}});
  for (const auto& [cell, part] : parts) {
    const Vec2 from = part.sum_px / part.count, to = from + magnified * part.sum_e / part.count;
    plot.lines.push_back({"", "c2", {from.x(), to.x()}, {-from.y(), -to.y()}});
    plot.marks.push_back({"", "c1", from.x(), -from.y()});
  }
  return svg(plot, {560, 380});
}

std::string errors_over_time(const Calibration& c) {
  Plot plot{.x_label = "time, s", .y_label = "rms of an image's corners, px", .from_zero = true};
  PlotLine line{"", "c1"};
  std::map<double, std::pair<double, int>> images;
  for (const CornerError& corner : c.fit.corners) {
    auto& [sum, count] = images[corner.t_s];
    sum += corner.e_px.squaredNorm();
    ++count;
  }
  for (const auto& [t, image] : images) line.add(t, std::sqrt(image.first / image.second));
  plot.lines.push_back(std::move(line));
  return svg(plot);
}

std::string error_histogram(const Calibration& c) {
  Histogram histogram{
      .x_label = "distance of a corner from where the fit has it, px", .style = "c1", .y_label = "corners"};
  for (const CornerError& corner : c.fit.corners) histogram.values.push_back(corner.e_px.norm());
  histogram.upper = 6 * c.fit.noise.corner_px;
  return svg(histogram);
}

std::string turn_plot(const Calibration& c) {
  Plot plot{.x_label = "time, s", .y_label = "turning about the IMU's axes, deg/s"};
  const FittedMotion motion = c.fit.state.motion();
  static constexpr std::array<const char*, 3> kNames = {"x", "y", "z"}, kStyles = {"c1", "c2", "c3"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    PlotLine line{kNames[axis], kStyles[axis]};
    for (double t = 0; t < c.fit.state.duration_s; t += 0.05)
      line.add(t, motion.at(t).omega_B[static_cast<int>(axis)] * kInDegrees);
    plot.lines.push_back(std::move(line));
  }
  return svg(plot, {1180, 260});
}

}  // namespace

std::string calibration_html(const Calibration& c, const CalibrateSettings& settings) {
  const RigColumns columns(0, c.camera.parameters.model);
  std::string body = "<div class=\"tiles\">";
  body += html_tile(fmt::format("{:.3f} px", c.fit.rms_px), "rms distance of the corners from the fit");
  body +=
      html_tile(fmt::format("{:.2f} px", c.lens_px), "how far a pixel may be off for what is not known of the lens");
  body += html_tile(fmt::format("{:.2f} ms", 1e3 * c.camera.time_offset_s),
                    fmt::format("time offset, ± {:.2f} ms", 1e3 * c.fit.sigma(columns.time_offset)));
  body += html_tile(fmt::format("{:.0f} %", 100 * c.covered), "of the image saw the board");
  body += "</div><div class=\"grid2\">";
  body +=
      html_card("How good it is", "what flights need; a poor figure says what to do about it", verdict_rows(c), true);
  body += html_card("Figures",
                    "sigmas are the larger of what white noise leaves and what the measurements' own "
                    "disagreement shows, by second, by corner of the board and by part of the image",
                    figure_rows(c));
  body += html_card("Errors over the image", "mean error of each part, magnified. No pattern: the lens model fits",
                    error_map(c));
  body += html_card("Errors over time", "peaks are blurred images, or a time offset that does not hold",
                    errors_over_time(c));
  body += html_card("Errors of corners", "", error_histogram(c));
  body += html_card("How the rig was turned", "rotation, place and time offset are seen in turns about all axes",
                    turn_plot(c), true);
  body += "</div>";
  return html_page(
      "calibration of " + settings.dataset.filename().string(),
      fmt::format("{}: {} images at {:.1f} Hz, IMU at {:.0f} Hz, {:.1f} s; {}", settings.dataset.string(), c.fit.views,
                  c.image_rate_hz, c.imu_rate_hz, c.fit.state.duration_s, program_text(program_info())),
      body);
}

}  // namespace epiline
