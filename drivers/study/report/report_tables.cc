#include "drivers/study/report/report_tables.h"

#include <fmt/format.h>

#include "drivers/study/report/page.h"
#include "drivers/study/report/stats_json.h"
#include "drivers/study/report/svg_plot.h"

namespace epiline {

namespace {

constexpr std::size_t kShownProbabilities[] = {0, 4, 8, 9, 10};  // 10, 50, 90, 95, 99 %

template <class... Values>
HtmlRow row_of(const Values&... values) {
  return {fmt::format("{}", values)...};
}

std::string number(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

HtmlRow summary_row(const char* name, const Summary& s) {
  if (s.count == 0) return {name, "–", "–", "–", "–", "–"};
  return {name, number(s.mean, 3), number(s.median, 3), number(s.p95, 3), number(s.p99, 3), number(s.max, 3)};
}

}  // namespace

std::string consistency_table(const Consistency& c) {
  HtmlRow head{"error of", "NEES", "claimed:"};
  for (const std::size_t i : kShownProbabilities) head.push_back(number(100 * kClaimedProbabilities[i], 0) + " %");
  std::vector<HtmlRow> rows;
  const auto add = [&](const char* name, const std::optional<double>& nees, const CalibrationCurve& curve) {
    if (!nees) return;
    rows.push_back({name, number(*nees, 2), "actual:"});
    for (const std::size_t i : kShownProbabilities) rows.back().push_back(number(100 * curve.share[i], 0) + " %");
  };
  add("position", c.position, c.curves.position);
  add("yaw", c.yaw, c.curves.yaw);
  add("tilt", c.tilt, c.curves.tilt);
  add("velocity", c.velocity, c.curves.velocity);
  return html_table(head, rows);
}

std::string motion_table(const TrajectoryErrors& e) {
  std::vector<HtmlRow> rows;
  for (const MotionError& m : e.motion) {
    const Summary &t = m.translation_m, &r = m.rotation_deg;
    rows.push_back({number(m.seconds, 0) + " s", number(1000 * t.rmse, 1), number(1000 * t.median, 1),
                    number(1000 * t.p95, 1), number(r.rmse, 3), number(r.median, 3), number(r.p95, 3)});
  }
  return html_table({"motion over", "rms, mm", "median", "95 %", "rms, deg", "median", "95 %"}, rows);
}

std::string error_table(const TrajectoryErrors& e) {
  std::vector<HtmlRow> positions, drifts;
  for (const auto& [name, a] :
       {std::pair{"aligned in position and heading (4 DoF)", &e.ate_4dof}, std::pair{"also in tilt, SE(3)", &e.ate_se3},
        std::pair{"also in scale, Sim(3)", &e.ate_sim3}})
    positions.push_back(
        {name, number(a->rmse, 4), number(a->mean, 4), number(a->median, 4), number(a->p95, 4), number(a->max, 4)});
  for (const RelativeError& r : e.rpe)
    drifts.push_back({number(r.distance_m, 0) + " m", number(r.translation_percent, 2) + " %",
                      number(r.rotation_deg, 2) + "°", std::to_string(r.pairs)});
  return html_table({"position error, m", "rms", "mean", "median", "95 %", "max"}, positions) +
         html_table({"drift over", "translation", "rotation", "segments"}, drifts);
}

std::string timing_table(const FlightRecord& record) {
  const Timing t = timing_of(record);
  const auto table = [](const char* what, const std::vector<HtmlRow>& rows) {
    return html_table({what, "mean", "median", "95 %", "99 %", "max"}, rows);
  };
  return table("time, ms", {summary_row("track: image to tracked features", t.track),
                            summary_row("solve: the optimisation alone", t.solve),
                            summary_row("marginalise: states that leave the window", t.marginalise),
                            summary_row("estimate: the whole step of the estimator", t.estimate),
                            summary_row("frame: track + estimate", t.frame),
                            summary_row("latency: image timestamp to odometry", t.latency)}) +
         table("processor time, ms", {summary_row("track", t.cpu.track), summary_row("solve", t.cpu.solve),
                                      summary_row("marginalise", t.cpu.marginalise),
                                      summary_row("estimate", t.cpu.estimate), summary_row("frame", t.cpu.frame)});
}

std::string count_table(const FlightRecord& r) {
  std::uint64_t skipped = 0;
  for (const auto& reason : r.skipped) skipped += reason.second;
  const auto seconds = state_seconds(r);
  const EstimatorStats& e = r.estimator;
  const ImuLeftOut left_out = imu_left_out(r);
  return html_table(
      {}, {{"images read / solved / predicted / skipped",
            fmt::format("{} / {} / {} / {}", r.images_read, e.frames_solved, e.frames_predicted, skipped)},
           {"IMU samples used / out of order / repeated / not finite",
            fmt::format("{} / {} / {} / {}", e.imu_samples, left_out.out_of_order, left_out.duplicate,
                        left_out.not_finite + left_out.impossible)},
           row_of("corrupt IMU samples replaced", e.imu_bridged),
           {"IMU gaps / saturated samples", fmt::format("{} / {}", e.imu_gaps, e.imu_saturated)},
           {"time initialising / tracking / degraded / lost, s",
            fmt::format("{:.1f} / {:.1f} / {:.1f} / {:.1f}", seconds[0], seconds[1], seconds[2], seconds[3])},
           {"attempted starts / resets", fmt::format("{} / {}", e.start_attempts, e.resets)},
           {"noise of a track, px", number(e.pixel_sigma, 2)},
           {"peak memory, MiB", number(r.peak_rss_mib, 0)},
           {"heap calls of the stages", r.heap_calls ? std::to_string(*r.heap_calls) : "not counted in this build"}});
}

std::string thread_table(const FlightRecord& r) {
  std::vector<HtmlRow> threads, rings;
  for (const RealtimeReport::Thread& t : r.realtime->report.threads)
    threads.push_back(row_of(t.name, t.shortfall.priority ? 0 : t.priority,
                             r.heap_calls ? std::to_string(t.costs.heap_calls) : "–",
                             r.lock_calls ? std::to_string(t.costs.lock_calls) : "–", t.costs.page_faults,
                             t.costs.switched_out, number(1e-9 * static_cast<double>(t.costs.cpu_ns), 2)));
  for (const RealtimeReport::Ring& ring : r.realtime->report.rings)
    rings.push_back(row_of(ring.name, ring.capacity, ring.high_water, ring.passed, ring.dropped));
  return html_table({"thread", "priority", "heap calls", "locks", "page faults", "preempted", "processor time, s"},
                    threads) +
         html_table({"ring", "capacity", "largest fill", "passed", "dropped"}, rings);
}

std::string output_table(const RealtimeRecord& r) {
  std::vector<HtmlRow> rows;
  for (const OutputRecord& o : r.outputs) {
    rows.push_back(row_of(escaped(o.name), o.sent, o.not_sent, o.reopened, o.latency.count()));
    for (const std::int64_t ns : {o.latency.quantile_ns(0.5), o.latency.quantile_ns(0.99), o.latency.most_ns()})
      rows.back().push_back(o.latency.count() > 0 ? number(1e-6 * static_cast<double>(ns), 2) : "–");
  }
  return html_table({"receiver", "sent", "not sent", "reopened", "images", "median, ms", "99 %, ms", "max, ms"}, rows);
}

std::string device_table(const RealtimeRecord& r) {
  std::vector<HtmlRow> rows;
  for (const DeviceRecord& device : r.devices) {
    std::string counts, clock = "the computer's";
    for (const DeviceCount& c : device.counts)
      counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", escaped(c.name), c.value);
    if (const auto& c = device.clock) {
      clock = fmt::format("{}, {:+.1f} ppm, {:.0f} us rms", kClockStatusNames[static_cast<std::size_t>(c->status)],
                          c->skew_ppm, 1e-3 * static_cast<double>(c->residual_rms.ns));
    }
    rows.push_back({escaped(device.name), counts, clock});
  }
  return html_table({"device", "counters", "clock"}, rows);
}

}  // namespace epiline
