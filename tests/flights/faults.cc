// The table of docs/troubleshooting.md: a flight with exact truth once for each fault.
#include <fmt/format.h>

#include <cstdio>
#include <string>

#include "tests/flights/fault_run.h"
#include "tests/flights/studies.h"

namespace epiline::faults {
namespace {

struct Options {
  ReplayOptions replay;
  double at_s = 10, speed = 0;
  std::string only;
};

struct Case {
  std::string name;
  std::vector<Fault> faults;
  double to_s = 0, said_until_s = 0;
};

std::vector<Case> cases(double at_s) {
  std::vector<Case> list{{"(none)", {}, at_s, at_s + 2}};
  const auto add = [&](const FaultInfo& info, double duration_s) {
    const bool ends = duration_s < 1000;
    list.push_back({ends ? fmt::format("{}, {:g} s", info.name, duration_s) : info.name,
                    {{info.kind, at_s, duration_s}},
                    at_s + (ends ? duration_s : 0),
                    ends ? at_s + duration_s + 2 : 1e9});
  };
  for (const FaultInfo& info : all_faults()) {
    if (info.kind == FaultKind::kCameraSilent) {
      for (const double s : {0.1, 1.0, 5.0}) add(info, s);
    } else if (info.kind == FaultKind::kImuSilent) {
      for (const double s : {0.01, 0.1, 1.0}) add(info, s);
    } else {
      add(info, info.usual_duration_s);
    }
  }
  return list;
}

void print(const Case& c, const test::FaultVerdict& v) {
  std::string states;
  if (v.degraded) states += "degraded ";
  if (v.lost) states += "lost ";
  if (v.initialising) states += "initialising ";
  fmt::print("| {:24} | {} | {}| {} | {:.1f} | {:.3f} | {} | {:.1f} {} at {:.1f} s | {}/{} |\n", c.name,
             test::reason_names(v.reasons & ~v.reasons_before), states.empty() ? "tracking " : states,
             v.recovered_s < 0 ? "never" : fmt::format("{:.1f}", v.recovered_s), v.not_tracking_s, v.final_error_m,
             v.resets, v.worst_ratio, v.worst_what, v.worst_at_s, v.wrong, v.published);
  std::fflush(stdout);
}

int run(Options& o) {
  o.replay.duration_s = o.at_s + 14;
  if (o.speed > 0) o.replay.realtime_speed = o.speed;
  const auto dataset = open_asl_dataset(o.replay.dataset, o.replay.camera, {}, {});
  if (!dataset || !dataset->ground_truth) {
    fmt::print(stderr, "no data set with truth\n");
    return 2;
  }
  fmt::print(
      "| fault | said | health | recovered after, s | not tracking, s | error at the end, m | resets | worst error / "
      "sigma called tracking | wrong |\n");
  for (const Case& c : cases(o.at_s)) {
    if (!o.only.empty() && c.name.find(o.only) == std::string::npos) continue;
    print(c, test::fly_with(o.replay, c.faults, {o.at_s, c.to_s, c.said_until_s}));
  }
  return 0;
}

std::function<int()> add(CLI::App& app) {
  static Options o;
  app.add_option("DATASET", o.replay.dataset)->required();
  app.add_option("--at", o.at_s, "s after the first image")->capture_default_str();
  app.add_option("--speed", o.speed, "in threads, times as fast; 0: in one thread")->capture_default_str();
  app.add_option("--only", o.only, "faults with this in their name");
  app.add_option("--config", o.replay.config_file, "settings");
  return [] { return run(o); };
}
const StudyEntry kEntry("faults", "Faults of sensors in a flight with exact truth", add);

}  // namespace
}  // namespace epiline::faults
