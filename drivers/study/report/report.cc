#include "drivers/study/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "drivers/study/report/page.h"
#include "drivers/study/report/report_tables.h"
#include "drivers/study/report/stats_json.h"
#include "drivers/study/report/svg_plot.h"
#include "pipeline/text/suspicion_text.h"

namespace epiline {

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegree = std::numbers::pi / 180;

/// Times of all images in seconds from the first, and columns over them.
struct Columns {
  std::vector<double> t;
  explicit Columns(const FlightRecord& record) : record_(record) {
    for (const ImageRecord& image : record.images) t.push_back((image.stamp - record.images.front().stamp).seconds());
  }
  template <class F>
  std::vector<double> of(F value) const {
    std::vector<double> column;
    for (const ImageRecord& image : record_.images) column.push_back(value(image));
    return column;
  }
  /// nan where there is no pose, so that lines are interrupted.
  template <class F>
  std::vector<double> of_poses(F value) const {
    return of([&](const ImageRecord& image) { return image.has_pose ? value(image) : kNan; });
  }

 private:
  const FlightRecord& record_;
};

std::string or_dash(const std::optional<double>& value, const char* format) {
  return value ? fmt::format(fmt::runtime(format), *value) : "–";
}

std::string tiles(const FlightRecord& record, const std::optional<TrajectoryErrors>& errors) {
  const Timing timing = timing_of(record);
  std::string s;
  if (errors && errors->poses > 0) {
    s += html_tile(fmt::format("{:.3f} m", errors->ate_4dof.rmse), "position error, rms after 4-DoF alignment");
    s += html_tile(fmt::format("{:.2f} %", 100 * errors->ate_4dof.rmse / std::max(errors->path_length_m, 1e-9)),
                   fmt::format("of the path length of {:.1f} m", errors->path_length_m));
    s += html_tile(fmt::format("{:+.2f} %", 100 * errors->scale_error), "scale error");
    s += html_tile(fmt::format("{:+.2f}°", errors->yaw_drift_deg), "yaw drift");
    const Consistency& nees = errors->nees;
    s += html_tile(or_dash(nees.position, "{:.2f}") + " / " + or_dash(nees.yaw, "{:.2f}") + " / " +
                       or_dash(nees.tilt, "{:.2f}") + " / " + or_dash(nees.velocity, "{:.2f}"),
                   "NEES of position / yaw / tilt / velocity (1: consistent)");
  }
  for (const std::string& text : texts_of(record.estimator.suspicions)) s += html_tile("!", text);
  s += html_tile(or_dash(start_seconds(record), "{:.2f} s"), "from the first image to the first pose");
  const auto covered = coverage(record);
  s += html_tile(covered ? fmt::format("{:.1f} %", 100 * *covered) : "–", "of the images since then have a pose");
  s += html_tile(fmt::format("{:.2f} ms", timing.frame.mean),
                 fmt::format("per image (mean); 99 % below {:.2f} ms", timing.frame.p99));
  return R"(<div class="tiles">)" + s + "</div>";
}

/// The path in two of the three axes.
Plot path_plot(const FlightRecord& record, const Overlay& c, int horizontal, int vertical) {
  const char* names[] = {"x, m", "y, m", "z, m"};
  Plot plot{.x_label = names[horizontal], .y_label = names[vertical], .equal_axes = true};
  PlotLine estimate{"estimate", "c1"}, truth{"ground truth", "truth"};
  for (const PosePair& pair : c.pairs) truth.add(pair.reference.p_WB[horizontal], pair.reference.p_WB[vertical]);
  for (const TimedPose& pose : trajectory_of(record).poses) {
    const Vec3 p = c.T(pose.p_WB);
    estimate.add(p[horizontal], p[vertical]);
  }
  if (!estimate.x.empty()) plot.marks = {{"start", "c1", estimate.x.front(), estimate.y.front()}};
  if (!truth.x.empty()) plot.lines.push_back(std::move(truth));
  plot.lines.push_back(std::move(estimate));
  return plot;
}

/// An error of each pair over time, nan where there is none.
template <class F>
std::vector<double> over_images(const FlightRecord& record, const Overlay& c, F error) {
  std::vector<double> column(record.images.size(), kNan);
  std::vector<std::size_t> image_of_pose;
  for (std::size_t i = 0; i < record.images.size(); ++i) {
    if (record.images[i].has_pose) image_of_pose.push_back(i);
  }
  for (const PosePair& pair : c.pairs) column[image_of_pose[pair.index]] = error(pair);
  return column;
}

std::vector<double> negated(std::vector<double> values) {
  for (double& v : values) v = -v;
  return values;
}

/// Of what is finite.
double largest_of(const std::vector<double>& values) {
  double largest = 0;
  for (const double v : values)
    if (std::isfinite(v)) largest = std::max(largest, std::abs(v));
  return largest;
}

Plot position_error_plot(const FlightRecord& record, const Columns& columns, const Overlay& c) {
  Plot plot{.x_label = "time, s", .y_label = "position, m", .from_zero = true};
  const auto sigma3 = columns.of_poses(
      [](const ImageRecord& i) { return 3 * std::sqrt(std::max(0.0, i.uncertainty.position.trace())); });
  plot.bands = {{"c1", columns.t, std::vector<double>(sigma3.size(), 0), sigma3}};
  plot.lines = {{"claimed 3 sigma", "c1 dashed", columns.t, sigma3}};
  if (c.pairs.empty()) return plot;
  const auto error =
      over_images(record, c, [&](const PosePair& p) { return (p.reference.p_WB - c.T(p.estimate.p_WB)).norm(); });
  plot.lines.push_back({"error", "c2", columns.t, error});
  plot.y_cap = std::max(5 * largest_of(error), 1e-3);  // a band far wider than the error must not flatten the error
  return plot;
}

Plot yaw_error_plot(const FlightRecord& record, const Columns& columns, const Overlay& c) {
  Plot plot{.x_label = "time, s", .y_label = "yaw, deg"};
  const auto sigma3 = columns.of_poses(
      [](const ImageRecord& i) { return 3 * std::sqrt(std::max(0.0, i.uncertainty.yaw_variance)) / kDegree; });
  plot.bands = {{"c1", columns.t, negated(sigma3), sigma3}};
  plot.lines = {{"claimed 3 sigma", "c1 dashed", columns.t, sigma3}, {"", "c1 dashed", columns.t, negated(sigma3)}};
  if (c.pairs.empty()) return plot;
  const auto error = over_images(record, c, [&](const PosePair& p) {
    return std::remainder(yaw_error(p) - c.heading_rad, 360 * kDegree) / kDegree;
  });
  plot.lines.push_back({"error", "c2", columns.t, error});
  return plot;
}

/// Three components over time, times `scale`, with their 3-sigma bands; the truth dashed, if there is any.
std::string vector_card(const char* title, const char* label, double scale, Vec3 ImageRecord::*value,
                        Vec3 ImageRecord::*sigma, const FlightRecord& record, const Columns& columns,
                        const std::vector<Vec3>& truth) {
  Plot plot{.x_label = "time, s", .y_label = label};
  const char* names[] = {"x", "y", "z"};
  const char* styles[] = {"c1", "c2", "c3"};
  double largest = 0;
  for (int k = 0; k < 3; ++k) {
    const auto middle = columns.of_poses([&](const ImageRecord& i) { return scale * (i.*value)[k]; });
    const auto edge = [&](int sigmas) {
      return columns.of_poses([&](const ImageRecord& i) { return scale * ((i.*value)[k] + sigmas * (i.*sigma)[k]); });
    };
    plot.bands.push_back({styles[k], columns.t, edge(-3), edge(3)});
    plot.lines.push_back({names[k], styles[k], columns.t, middle});
    PlotLine line{"", std::string(styles[k]) + " dashed"};
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const double t = (record.truth->poses[i].stamp - record.images.front().stamp).seconds();
      if (t >= 0 && t <= columns.t.back()) line.add(t, scale * truth[i][k]);
    }
    largest = std::max({largest, largest_of(plot.lines.back().y), largest_of(line.y)});
    if (!truth.empty()) plot.lines.push_back(std::move(line));
  }
  plot.y_cap = 1.6 * largest;  // wide bands at the start must not flatten the rest
  return html_card(title, std::string("bands: claimed 3 sigma") + (truth.empty() ? "" : "; dashed: ground truth"),
                   svg(plot));
}

/// Truth of velocity turned into the estimate's world, so that both can be compared.
std::vector<Vec3> truth_velocity(const FlightRecord& record, const Overlay& c) {
  std::vector<Vec3> v;
  for (const Vec3& truth : record.truth->v_WB_m_s) v.push_back(c.T.R.transpose() * truth);
  return v;
}

/// `is_latency`: of the way to the outside every single image counts, so its axis reaches to the slowest.
std::string histogram(const char* title, const char* style, std::vector<double> values, bool is_latency = false) {
  if (values.empty())
    return fmt::format("<div><h3>{}</h3><p>{}</p></div>", title,
                       is_latency ? "no odometry was published" : "did not run");
  const Summary summary = summarise(values);
  Histogram h{.x_label = is_latency ? "ms, logarithmic" : "ms",
              .style = style,
              .values = std::move(values),
              .logarithmic = is_latency};
  h.upper = is_latency ? summary.max : std::max(std::min(1.05 * summary.p99, 3 * summary.p90), 1e-3);
  h.marks = {{fmt::format("median {:.3g} ms", summary.median), "", summary.median, 0},
             {fmt::format("99 % {:.3g} ms", summary.p99), "", summary.p99, 0}};
  if (is_latency) h.marks.push_back({fmt::format("max {:.3g} ms", summary.max), "", summary.max, 0});
  const std::string figures = is_latency ? fmt::format(", {} images", summary.count)
                                         : fmt::format(": mean {:.3f} ms, max {:.2f} ms", summary.mean, summary.max);
  return fmt::format("<div><h3>{}{}</h3>{}</div>", title, figures, svg(h, {380, 210}));
}

std::string histograms(const FlightRecord& record) {
  std::string s = R"(<div class="three">)" + histogram("track", "c1", times_of(record, &StageMilliseconds::track)) +
                  histogram("solve", "c2", times_of(record, &StageMilliseconds::solve)) +
                  histogram("estimate", "c3", times_of(record, &StageMilliseconds::estimate));
  if (record.realtime) s += histogram("latency: image timestamp to odometry", "c1", latencies_of(record), true);
  return s + "</div>";
}

Plot tracks_plot(const Columns& columns) {
  Plot plot{.x_label = "time, s", .y_label = "tracks", .from_zero = true};
  plot.lines = {
      {"tracks", "c1", columns.t, columns.of([](const ImageRecord& i) { return static_cast<double>(i.tracks); })},
      {"new", "c2 thin", columns.t,
       columns.of([](const ImageRecord& i) { return static_cast<double>(i.new_tracks); })}};
  return plot;
}

Plot health_plot(const FlightRecord& record, const Columns& columns) {
  const char* styles[] = {"initialising", "tracking", "degraded", "lost"};
  Plot plot{.x_label = "time, s", .y_label = "quality, 0 to 100", .from_zero = true};
  for (std::size_t i = 0; i + 1 < columns.t.size(); ++i) {
    const char* style = styles[static_cast<int>(record.images[i].health.state)];
    if (!plot.spans.empty() && plot.spans.back().style == style) {
      plot.spans.back().to = columns.t[i + 1];
    } else {
      plot.spans.push_back({style, columns.t[i], columns.t[i + 1]});
    }
  }
  plot.lines = {{"", "c1", columns.t,
                 columns.of([](const ImageRecord& i) { return std::max(0.0, static_cast<double>(i.health.quality)); })},
                {"", "none", {columns.t.front()}, {100}}};
  return plot;
}

constexpr const char* kCalibrationNote =
    "share of poses whose error lies inside the region that the claimed covariance gives this probability. On the grey "
    "line the claim is true; below it (shaded) errors are larger than claimed, above it smaller. The poses of a flight "
    "share most of their error: judge by many flights";

/// Share of errors inside the claimed regions over the claimed probability, a line for each quantity. Empty without
/// any.
std::string calibration_svg(const CalibrationCurves& curves) {
  Plot plot{.x_label = "claimed probability, %", .y_label = "share of poses, %"};
  plot.bands = {{"lost", {0, 100}, {0, 0}, {0, 100}}};
  plot.lines = {{"claim is true", "truth", {0, 100}, {0, 100}}};
  const auto add = [&](const char* label, const char* style, const CalibrationCurve& curve) {
    if (curve.errors == 0) return;
    PlotLine line{label, style, {0}, {0}};
    for (std::size_t i = 0; i < curve.share.size(); ++i) line.add(100 * kClaimedProbabilities[i], 100 * curve.share[i]);
    line.add(100, 100);
    plot.lines.push_back(std::move(line));
  };
  add("position", "c1", curves.position);
  add("yaw", "c2", curves.yaw);
  add("tilt", "c3", curves.tilt);
  add("velocity", "c4", curves.velocity);
  return plot.lines.size() > 1 ? svg(plot, {560, 380}) : "";
}

constexpr const char* kHealthKey =
    R"html(<span class="key"><i style="background:var(--truth)"></i>initialising<i style="background:var(--good)"></i>tracking)html"
    R"html(<i style="background:var(--warn)"></i>degraded<i style="background:var(--bad)"></i>lost</span>)html";

}  // namespace

std::string report_html(const FlightRecord& record, const std::optional<TrajectoryErrors>& errors,
                        const ProgramInfo& program) {
  const double length_s =
      record.images.empty() ? 0 : (record.images.back().stamp - record.images.front().stamp).seconds();
  const std::string subtitle = fmt::format("{} images, {:.1f} s; {} factor, {} keyframes; {}", record.images.size(),
                                           length_s, record.visual_factor, record.keyframes, program_text(program));
  if (record.images.empty())
    return html_page(record.dataset_path, subtitle, "<p>No image went through the pipeline.</p>");
  const Overlay c = record.truth ? overlay(trajectory_of(record), *record.truth) : Overlay{};
  const Columns columns(record);
  const bool truth = !c.pairs.empty();
  const std::vector<Vec3> none, truth_v = truth ? truth_velocity(record, c) : none;
  const std::string aligned =
      truth ? "estimate at the time of each image, aligned with the ground truth in position and heading"
            : "no ground truth";
  std::string s = tiles(record, errors) + R"(<div class="grid2">)";
  s += html_card("Path from above", aligned, svg(path_plot(record, c, 0, 1), {560, 380}));
  s += html_card("Path from the side", aligned, svg(path_plot(record, c, 0, 2), {560, 380}));
  s += html_card(
      "Position error",
      "with the uncertainty that the estimator claimed at that time; it is relative to the start, so it grows",
      svg(position_error_plot(record, columns, c)));
  s += html_card("Yaw error", "without its mean, because the initial heading is arbitrary",
                 svg(yaw_error_plot(record, columns, c)));
  if (const std::string plot = errors ? calibration_svg(errors->nees.curves) : ""; !plot.empty())
    s += html_card("Claimed and actual error", kCalibrationNote,
                   fmt::format(R"(<div class="two"><div>{}</div><div>{}</div></div>)", plot,
                               consistency_table(errors->nees) + motion_table(*errors)),
                   true);
  s += vector_card("Velocity", "m/s", 1, &ImageRecord::v_WB_m_s, &ImageRecord::sigma_v_m_s, record, columns, truth_v);
  s += vector_card("Gyroscope bias", "deg/s", 1 / kDegree, &ImageRecord::b_g_rad_s, &ImageRecord::sigma_b_g_rad_s,
                   record, columns, truth ? record.truth->gyroscope_bias_rad_s : none);
  s += vector_card("Accelerometer bias", "m/s²", 1, &ImageRecord::b_a_m_s2, &ImageRecord::sigma_b_a_m_s2, record,
                   columns, truth ? record.truth->accelerometer_bias_m_s2 : none);
  s += html_card("Tracks per image", "features followed from the previous image, and new ones",
                 svg(tracks_plot(columns)));
  s += html_card("Health", kHealthKey, svg(health_plot(record, columns), {1140, 200}), true);
  s += html_card("Time per image",
                 "wall time; the last bar holds all longer times. No time includes the decoding of files",
                 histograms(record) + timing_table(record), true);
  if (errors && errors->poses > 0) s += html_card("Errors", "compared with the ground truth", error_table(*errors));
  if (record.realtime)
    s += html_card("Threads", "costs from the start of the threads to the end of the run", thread_table(record));
  if (record.realtime && !record.realtime->outputs.empty()) {
    s += html_card("Outputs",
                   "latency: from an image's timestamp to the last byte of the first message that contains it",
                   output_table(*record.realtime), true);
  }
  if (record.realtime && !record.realtime->devices.empty())
    s += html_card("Devices", "counters of their drivers", device_table(*record.realtime), true);
  s += html_card("Counters", "of this run", count_table(record));
  return html_page(record.dataset_path, subtitle, s + "</div>");
}

}  // namespace epiline
