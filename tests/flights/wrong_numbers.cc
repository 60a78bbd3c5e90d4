// A calibration that is wrong: a flight with truth, once for each number of tests/flights/wrong_number_run.cc. What is
// its error, what does it claim, does it say "tracking" where it is wrong, and does it name what is wrong?
#include "tests/flights/wrong_number_run.h"

#include <fmt/format.h>

#include <cstdio>
#include <string>

#include "tests/flights/studies.h"

namespace epiline::wrong_numbers {
namespace {

std::string nees(const std::optional<double>& v) { return v ? fmt::format("{:.1f}", *v) : "-"; }

int run(const ReplayOptions& options, const std::string& only) {
  fmt::print(
      "| wrong | ATE, m | NEES position, yaw, tilt, velocity | tracking | of that beyond 3.5 sigma | worst | resets | "
      "says |\n|---|---|---|---|---|---|---|---|\n");
  for (const test::WrongNumber& wrong : test::wrong_numbers()) {
    if (wrong.name.find(only) == std::string::npos) continue;
    const test::WrongNumberVerdict v = test::fly_with_wrong_number(options, wrong);
    if (!v.ran) {
      fmt::print(stderr, "no data set with ground truth\n");
      return 2;
    }
    std::string said;
    for (const std::string& s : v.suspects) said += (said.empty() ? "" : "; ") + s;
    if (said.empty()) said = "(" + test::reason_names(v.reasons) + ")";
    fmt::print("| {:28}{} | {} | {} {} {} {} | {:.0f} % | {:.0f} % | {:.1f} | {} | {} |\n", wrong.name,
               wrong.gross ? " (gross)" : "", v.ate_m < 0 ? "no pose" : fmt::format("{:.4f}", v.ate_m),
               nees(v.nees.position), nees(v.nees.yaw), nees(v.nees.tilt), nees(v.nees.velocity),
               100 * v.tracking_share, 100 * v.wrong_share, v.worst_ratio, v.resets, said);
    std::fflush(stdout);
  }
  return 0;
}

std::function<int()> add(CLI::App& app) {
  static ReplayOptions o;
  static std::string only;
  app.add_option("DATASET", o.dataset)->required();
  app.add_option("--config", o.config_file, "settings (TOML)");
  app.add_option("--set", o.set, "KEY=VALUE, wins over the file");
  app.add_option("--only", only, "numbers with this in their name");
  app.add_option("--start", o.start_s, "s after the first image");
  app.add_option("--duration", o.duration_s, "s of the flight");
  return [] { return run(o, only); };
}
const StudyEntry kEntry("wrong_numbers", "A flight with ground truth, with one number of its calibration wrong", add);

}  // namespace
}  // namespace epiline::wrong_numbers
