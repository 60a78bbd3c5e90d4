#include "drivers/study/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/study/report/calibration_plot.h"
#include "drivers/study/report/page.h"
#include "drivers/study/report/report_tables.h"
#include "drivers/study/report/stats_json.h"
#include "drivers/study/report/svg_plot.h"
#include "pipeline/text/suspicion_text.h"

namespace epiline {

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegree = 3.14159265358979323846 / 180;

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
  Plot plot;
  const char* names[] = {"x, m", "y, m", "z, m"};
  plot.x_label = names[horizontal];
  plot.y_label = names[vertical];
  plot.equal_axes = true;
  PlotLine estimate{"estimate", "c1", {}, {}}, truth{"ground truth", "truth", {}, {}};
  for (const PosePair& pair : c.pairs) {
    truth.x.push_back(pair.reference.p_WB[horizontal]);
    truth.y.push_back(pair.reference.p_WB[vertical]);
  }
  for (const TimedPose& pose : trajectory_of(record).poses) {
    const Vec3 p = c.T(pose.p_WB);
    estimate.x.push_back(p[horizontal]);
    estimate.y.push_back(p[vertical]);
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

Plot position_error_plot(const FlightRecord& record, const Columns& columns, const Overlay& c) {
  Plot plot;
  plot.x_label = "time, s";
  plot.y_label = "position, m";
  plot.from_zero = true;
  const auto sigma3 = columns.of_poses(
      [](const ImageRecord& i) { return 3 * std::sqrt(std::max(0.0, i.uncertainty.position.trace())); });
  plot.bands = {{"c1", columns.t, std::vector<double>(sigma3.size(), 0), sigma3}};
  const auto error =
      over_images(record, c, [&](const PosePair& p) { return (p.reference.p_WB - c.T(p.estimate.p_WB)).norm(); });
  plot.lines = {{"claimed 3 sigma", "c1 dashed", columns.t, sigma3}};
  if (!c.pairs.empty()) {
    plot.lines.push_back({"error", "c2", columns.t, error});
    double largest = 0;  // a band far wider than the error must not flatten the error
    for (const double e : error) largest = std::isfinite(e) ? std::max(largest, e) : largest;
    plot.y_cap = std::max(5 * largest, 1e-3);
  }
  return plot;
}

Plot yaw_error_plot(const FlightRecord& record, const Columns& columns, const Overlay& c) {
  Plot plot;
  plot.x_label = "time, s";
  plot.y_label = "yaw, deg";
  const auto sigma3 = columns.of_poses(
      [](const ImageRecord& i) { return 3 * std::sqrt(std::max(0.0, i.uncertainty.yaw_variance)) / kDegree; });
  plot.bands = {{"c1", columns.t, negated(sigma3), sigma3}};
  plot.lines = {{"claimed 3 sigma", "c1 dashed", columns.t, sigma3}, {"", "c1 dashed", columns.t, negated(sigma3)}};
  if (!c.pairs.empty()) {
    const auto error = over_images(record, c, [&](const PosePair& p) {
      return std::remainder(yaw_error(p) - c.heading_rad, 360 * kDegree) / kDegree;
    });
    plot.lines.push_back({"error", "c2", columns.t, error});
  }
  return plot;
}

/// Three components over time with their 3-sigma bands; the truth dashed, if there is any.
template <class Value, class Sigma>
Plot vector_plot(const Columns& columns, const std::string& label, double scale, Value value, Sigma sigma,
                 const FlightRecord& record, const std::vector<Vec3>* truth) {
  Plot plot;
  plot.x_label = "time, s";
  plot.y_label = label;
  const char* names[] = {"x", "y", "z"};
  const char* styles[] = {"c1", "c2", "c3"};
  for (int k = 0; k < 3; ++k) {
    const auto middle = columns.of_poses([&](const ImageRecord& i) { return scale * value(i)[k]; });
    const auto low = columns.of_poses([&](const ImageRecord& i) { return scale * (value(i)[k] - 3 * sigma(i)[k]); });
    const auto high = columns.of_poses([&](const ImageRecord& i) { return scale * (value(i)[k] + 3 * sigma(i)[k]); });
    plot.bands.push_back({styles[k], columns.t, low, high});
    plot.lines.push_back({names[k], styles[k], columns.t, middle});
    if (!truth) continue;
    PlotLine line{"", std::string(styles[k]) + " dashed", {}, {}};
    for (std::size_t i = 0; i < truth->size(); ++i) {
      const double t = (record.truth->poses[i].stamp - record.images.front().stamp).seconds();
      if (t < 0 || t > columns.t.back()) continue;
      line.x.push_back(t);
      line.y.push_back(scale * (*truth)[i][k]);
    }
    plot.lines.push_back(std::move(line));
  }
  double largest = 0;  // wide bands at the start must not flatten the rest
  for (const PlotLine& line : plot.lines) {
    for (const double v : line.y) largest = std::isfinite(v) ? std::max(largest, std::abs(v)) : largest;
  }
  plot.y_cap = 1.6 * largest;
  return plot;
}

/// Truth of velocity turned into the estimate's world, so that both can be compared.
std::vector<Vec3> truth_velocity(const FlightRecord& record, const Overlay& c) {
  std::vector<Vec3> v;
  for (const Vec3& truth : record.truth->v_WB_m_s) v.push_back(c.T.R.transpose() * truth);
  return v;
}

/// Of the way to the outside every single image counts: its axis reaches to the slowest.
std::string latency_histogram(const Summary& summary, std::vector<double> values) {
  if (values.empty()) return "<div><h3>latency: image timestamp to odometry</h3><p>no odometry was published</p></div>";
  Histogram h;
  h.x_label = "ms, logarithmic";
  h.style = "c1";
  h.logarithmic = true;
  h.upper = summary.max;
  h.values = std::move(values);
  h.marks = {{fmt::format("median {:.3g} ms", summary.median), "", summary.median, 0},
             {fmt::format("99 % {:.3g} ms", summary.p99), "", summary.p99, 0},
             {fmt::format("max {:.3g} ms", summary.max), "", summary.max, 0}};
  return fmt::format("<div><h3>latency: image timestamp to odometry, {} images</h3>{}</div>", summary.count,
                     svg(h, {380, 210}));
}

std::string histogram(const char* title, const char* style, const Summary& summary, std::vector<double> values) {
  if (values.empty()) return fmt::format("<div><h3>{}</h3><p>did not run</p></div>", title);
  Histogram h;
  h.x_label = "ms";
  h.style = style;
  h.values = std::move(values);
  h.upper = std::max(std::min(1.05 * summary.p99, 3 * summary.p90), 1e-3);
  h.marks = {{fmt::format("median {:.3g} ms", summary.median), "", summary.median, 0},
             {fmt::format("99 % {:.3g} ms", summary.p99), "", summary.p99, 0}};
  return fmt::format("<div><h3>{}: mean {:.3f} ms, max {:.2f} ms</h3>{}</div>", title, summary.mean, summary.max,
                     svg(h, {380, 210}));
}

std::string histograms(const FlightRecord& record) {
  const Timing timing = timing_of(record);
  std::vector<double> track, solve, estimate, latency;
  for (const ImageRecord& image : record.images) {
    if (record.tracker) track.push_back(image.wall_ms.track);
    if (image.latency_ms) latency.push_back(*image.latency_ms);
    if (!image.solved) continue;
    solve.push_back(image.wall_ms.solve);
    estimate.push_back(image.wall_ms.estimate);
  }
  return R"(<div class="three">)" + histogram("track", "c1", timing.track, std::move(track)) +
         histogram("solve", "c2", timing.solve, std::move(solve)) +
         histogram("estimate", "c3", timing.estimate, std::move(estimate)) +
         (record.realtime ? latency_histogram(timing.latency, std::move(latency)) : "") + "</div>";
}

Plot tracks_plot(const Columns& columns) {
  Plot plot;
  plot.x_label = "time, s";
  plot.y_label = "tracks";
  plot.from_zero = true;
  plot.lines = {
      {"tracks", "c1", columns.t, columns.of([](const ImageRecord& i) { return static_cast<double>(i.tracks); })},
      {"new", "c2 thin", columns.t,
       columns.of([](const ImageRecord& i) { return static_cast<double>(i.new_tracks); })}};
  return plot;
}

Plot health_plot(const FlightRecord& record, const Columns& columns) {
  const char* styles[] = {"initialising", "tracking", "degraded", "lost"};
  Plot plot;
  plot.x_label = "time, s";
  plot.y_label = "quality, 0 to 100";
  plot.from_zero = true;
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
  const auto* truth_v = truth && !record.truth->v_WB_m_s.empty() ? &record.truth->v_WB_m_s : nullptr;
  const std::vector<Vec3> turned_v = truth_v ? truth_velocity(record, c) : std::vector<Vec3>{};
  const auto* truth_bg =
      truth && !record.truth->gyroscope_bias_rad_s.empty() ? &record.truth->gyroscope_bias_rad_s : nullptr;
  const auto* truth_ba =
      truth && !record.truth->accelerometer_bias_m_s2.empty() ? &record.truth->accelerometer_bias_m_s2 : nullptr;
  const std::string truth_note = "bands: claimed 3 sigma";
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
  s += html_card("Velocity", truth_note + (truth_v ? "; dashed: ground truth" : ""),
                 svg(vector_plot(
                     columns, "m/s", 1, [](const ImageRecord& i) { return i.v_WB_m_s; },
                     [](const ImageRecord& i) { return i.sigma_v_m_s; }, record, truth_v ? &turned_v : nullptr)));
  s += html_card("Gyroscope bias", truth_note + (truth_bg ? "; dashed: ground truth" : ""),
                 svg(vector_plot(
                     columns, "deg/s", 1 / kDegree, [](const ImageRecord& i) { return i.b_g_rad_s; },
                     [](const ImageRecord& i) { return i.sigma_b_g_rad_s; }, record, truth_bg)));
  s += html_card("Accelerometer bias", truth_note + (truth_ba ? "; dashed: ground truth" : ""),
                 svg(vector_plot(
                     columns, "m/s²", 1, [](const ImageRecord& i) { return i.b_a_m_s2; },
                     [](const ImageRecord& i) { return i.sigma_b_a_m_s2; }, record, truth_ba)));
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
