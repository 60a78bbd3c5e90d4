#include "drivers/study/report/report_tables.h"

#include <fmt/format.h>

#include "drivers/study/report/stats_json.h"
#include "drivers/study/report/svg_plot.h"

namespace epiline {

namespace {

constexpr std::size_t kShownProbabilities[] = {0, 4, 8, 9, 10};  // 10, 50, 90, 95, 99 %

std::string summary_row(const char* name, const Summary& s, const char* format) {
  if (s.count == 0) return fmt::format("<tr><td>{}</td><td colspan=\"5\">–</td></tr>", name);
  const auto cell = [&](double v) { return "<td>" + fmt::format(fmt::runtime(format), v) + "</td>"; };
  return fmt::format("<tr><td>{}</td>", name) + cell(s.mean) + cell(s.median) + cell(s.p95) + cell(s.p99) +
         cell(s.max) + "</tr>";
}

std::string consistency_row(const char* name, const std::optional<double>& nees, const CalibrationCurve& curve) {
  if (!nees) return "";
  std::string s = fmt::format("<tr><td>{}</td><td>{:.2f}</td><td>actual:</td>", name, *nees);
  for (const std::size_t i : kShownProbabilities) s += fmt::format("<td>{:.0f} %</td>", 100 * curve.share[i]);
  return s + "</tr>";
}

}  // namespace

std::string consistency_table(const Consistency& c) {
  std::string s = "<table><tr><th>error of</th><th>NEES</th><th>claimed:</th>";
  for (const std::size_t i : kShownProbabilities) s += fmt::format("<th>{:.0f} %</th>", 100 * kClaimedProbabilities[i]);
  return s + "</tr>" + consistency_row("position", c.position, c.curves.position) +
         consistency_row("yaw", c.yaw, c.curves.yaw) + consistency_row("tilt", c.tilt, c.curves.tilt) +
         consistency_row("velocity", c.velocity, c.curves.velocity) + "</table>";
}

std::string motion_table(const TrajectoryErrors& e) {
  std::string s =
      "<table><tr><th>motion over</th><th>rms, mm</th><th>median</th><th>95 %</th><th>rms, deg</th><th>median</th>"
      "<th>95 %</th></tr>";
  for (const MotionError& m : e.motion) {
    const Summary &t = m.translation_m, &r = m.rotation_deg;
    s += fmt::format(
        "<tr><td>{:.0f} s</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.3f}</td><td>{:.3f}</td>"
        "<td>{:.3f}</td></tr>",
        m.seconds, 1000 * t.rmse, 1000 * t.median, 1000 * t.p95, r.rmse, r.median, r.p95);
  }
  return s + "</table>";
}

std::string error_table(const TrajectoryErrors& e) {
  std::string s =
      "<table><tr><th>position error, m</th><th>rms</th><th>mean</th><th>median</th><th>95 %</th><th>max</th></tr>";
  const std::pair<const char*, const Summary*> rows[] = {{"aligned in position and heading (4 DoF)", &e.ate_4dof},
                                                         {"also in tilt, SE(3)", &e.ate_se3},
                                                         {"also in scale, Sim(3)", &e.ate_sim3}};
  for (const auto& [name, a] : rows) {
    s += fmt::format("<tr><td>{}</td><td>{:.4f}</td><td>{:.4f}</td><td>{:.4f}</td><td>{:.4f}</td><td>{:.4f}</td></tr>",
                     name, a->rmse, a->mean, a->median, a->p95, a->max);
  }
  s += "</table><table><tr><th>drift over</th><th>translation</th><th>rotation</th><th>segments</th></tr>";
  for (const RelativeError& r : e.rpe) {
    s += fmt::format("<tr><td>{:.0f} m</td><td>{:.2f} %</td><td>{:.2f}°</td><td>{}</td></tr>", r.distance_m,
                     r.translation_percent, r.rotation_deg, r.pairs);
  }
  return s + "</table>";
}

std::string timing_table(const FlightRecord& record) {
  const Timing t = timing_of(record);
  return "<table><tr><th>time, ms</th><th>mean</th><th>median</th><th>95 %</th><th>99 %</th><th>max</th></tr>" +
         summary_row("track: image to tracked features", t.track, "{:.3f}") +
         summary_row("solve: the optimisation alone", t.solve, "{:.3f}") +
         summary_row("marginalise: states that leave the window", t.marginalise, "{:.3f}") +
         summary_row("estimate: the whole step of the estimator", t.estimate, "{:.3f}") +
         summary_row("frame: track + estimate", t.frame, "{:.3f}") +
         summary_row("latency: image timestamp to odometry", t.latency, "{:.3f}") +
         "<tr><th>processor time, ms</th><th>mean</th><th>median</th><th>95 %</th><th>99 %</th><th>max</th></tr>" +
         summary_row("track", t.cpu.track, "{:.3f}") + summary_row("solve", t.cpu.solve, "{:.3f}") +
         summary_row("marginalise", t.cpu.marginalise, "{:.3f}") + summary_row("estimate", t.cpu.estimate, "{:.3f}") +
         summary_row("frame", t.cpu.frame, "{:.3f}") + "</table>";
}

std::string count_table(const FlightRecord& r) {
  const auto row = [](const char* name, const std::string& value) {
    return fmt::format("<tr><td>{}</td><td>{}</td></tr>", name, value);
  };
  std::uint64_t skipped = 0;
  for (const auto& reason : r.skipped) skipped += reason.second;
  const auto seconds = state_seconds(r);
  const EstimatorStats& e = r.estimator;
  const ImuLeftOut left_out = imu_left_out(r);
  return "<table>" +
         row("images read / solved / predicted / skipped",
             fmt::format("{} / {} / {} / {}", r.images_read, e.frames_solved, e.frames_predicted, skipped)) +
         row("IMU samples used / out of order / repeated / not finite",
             fmt::format("{} / {} / {} / {}", e.imu_samples, left_out.out_of_order, left_out.duplicate,
                         left_out.not_finite + left_out.impossible)) +
         row("corrupt IMU samples replaced", fmt::format("{}", e.imu_bridged)) +
         row("IMU gaps / saturated samples", fmt::format("{} / {}", e.imu_gaps, e.imu_saturated)) +
         row("time initialising / tracking / degraded / lost, s",
             fmt::format("{:.1f} / {:.1f} / {:.1f} / {:.1f}", seconds[0], seconds[1], seconds[2], seconds[3])) +
         row("attempted starts / resets", fmt::format("{} / {}", e.start_attempts, e.resets)) +
         row("noise of a track, px", fmt::format("{:.2f}", e.pixel_sigma)) +
         row("peak memory, MiB", fmt::format("{:.0f}", r.peak_rss_mib)) +
         row("heap calls of the stages", r.heap_calls ? std::to_string(*r.heap_calls) : "not counted in this build") +
         "</table>";
}

std::string thread_table(const FlightRecord& r) {
  std::string s =
      "<table><tr><th>thread</th><th>priority</th><th>heap calls</th><th>locks</th><th>page faults</th>"
      "<th>preempted</th><th>processor time, s</th></tr>";
  for (const RealtimeReport::Thread& t : r.realtime->report.threads) {
    s += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.2f}</td></tr>",
                     t.name, t.shortfall.priority ? 0 : t.priority,
                     r.heap_calls ? std::to_string(t.costs.heap_calls) : "–",
                     r.lock_calls ? std::to_string(t.costs.lock_calls) : "–", t.costs.page_faults, t.costs.switched_out,
                     1e-9 * static_cast<double>(t.costs.cpu_ns));
  }
  s += "</table><table><tr><th>ring</th><th>capacity</th><th>largest fill</th><th>passed</th><th>dropped</th></tr>";
  for (const RealtimeReport::Ring& ring : r.realtime->report.rings) {
    s += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>", ring.name, ring.capacity,
                     ring.high_water, ring.passed, ring.dropped);
  }
  return s + "</table>";
}

std::string output_table(const RealtimeRecord& r) {
  const auto ms = [](std::int64_t ns) { return 1e-6 * static_cast<double>(ns); };
  std::string s =
      "<table><tr><th>receiver</th><th>sent</th><th>not sent</th><th>reopened</th><th>images</th><th>median, ms</th>"
      "<th>99 %, ms</th><th>max, ms</th></tr>";
  for (const OutputRecord& o : r.outputs) {
    s += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>", escaped(o.name), o.sent, o.not_sent,
                     o.reopened, o.latency.count());
    for (const std::int64_t ns : {o.latency.quantile_ns(0.5), o.latency.quantile_ns(0.99), o.latency.most_ns()})
      s += o.latency.count() > 0 ? fmt::format("<td>{:.2f}</td>", ms(ns)) : "<td>–</td>";
    s += "</tr>";
  }
  return s + "</table>";
}

std::string device_table(const RealtimeRecord& r) {
  std::string s = "<table><tr><th>device</th><th>counters</th><th>clock</th></tr>";
  for (const DeviceRecord& device : r.devices) {
    std::string counts, clock = "the computer's";
    for (const DeviceCount& c : device.counts)
      counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", escaped(c.name), c.value);
    if (const auto& c = device.clock) {
      clock = fmt::format("{}, {:+.1f} ppm, {:.0f} us rms", kClockStatusNames[static_cast<std::size_t>(c->status)],
                          c->skew_ppm, 1e-3 * static_cast<double>(c->residual_rms.ns));
    }
    s += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>", escaped(device.name), counts, clock);
  }
  return s + "</table>";
}

}  // namespace epiline
