#include "drivers/study/report/calibration_plot.h"

#include <utility>

#include "drivers/study/report/svg_plot.h"

namespace epiline {

namespace {

void add_line(const char* label, const char* style, const CalibrationCurve& curve, Plot& plot) {
  if (curve.errors == 0) return;
  PlotLine line{label, style, {0}, {0}};
  for (std::size_t i = 0; i < curve.share.size(); ++i) {
    line.x.push_back(100 * kClaimedProbabilities[i]);
    line.y.push_back(100 * curve.share[i]);
  }
  line.x.push_back(100);
  line.y.push_back(100);
  plot.lines.push_back(std::move(line));
}

}  // namespace

const char* const kCalibrationNote =
    "share of poses whose error lies inside the region that the claimed covariance gives this probability. On the grey "
    "line the claim is true; below it (shaded) errors are larger than claimed, above it smaller. The poses of a flight "
    "share most of their error: judge by many flights";

std::string calibration_svg(const CalibrationCurves& curves) {
  Plot plot;
  plot.x_label = "claimed probability, %";
  plot.y_label = "share of poses, %";
  plot.bands = {{"lost", {0, 100}, {0, 0}, {0, 100}}};
  add_line("position", "c1", curves.position, plot);
  add_line("yaw", "c2", curves.yaw, plot);
  add_line("tilt", "c3", curves.tilt, plot);
  add_line("velocity", "c4", curves.velocity, plot);
  if (plot.lines.empty()) return "";
  plot.lines.insert(plot.lines.begin(), {"claim is true", "truth", {0, 100}, {0, 100}});
  return svg(plot, {560, 380});
}

}  // namespace epiline
