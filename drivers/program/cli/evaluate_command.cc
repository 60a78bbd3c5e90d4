#include <fmt/format.h>

#include <string>

#include "drivers/program/cli/commands.h"
#include "drivers/study/evaluate/errors.h"
#include "drivers/study/evaluate/odometry_file.h"
#include "drivers/study/report/errors_json.h"

namespace epiline {

namespace {

struct EvaluateArguments {
  std::string estimate, reference, align = "4dof";
  bool json = false;
};

void print_summary(const std::string& label, const Summary& s) {
  fmt::print("{:<10} {:9.4f} {:9.4f} {:9.4f} {:9.4f} {:9.4f}\n", label, s.rmse, s.mean, s.median, s.p95, s.max);
}

void print_curve(const char* quantity, const std::optional<double>& nees, const CalibrationCurve& curve) {
  if (!nees) return;
  fmt::print("{:<10} {:8.2f}", quantity, *nees);
  for (const double share : curve.share) fmt::print(" {:3.0f}", 100 * share);
  fmt::print("\n");
}

void print_consistency(const Consistency& c) {
  fmt::print("claimed        NEES");
  for (const double p : kClaimedProbabilities) fmt::print(" {:3.0f}", 100 * p);
  fmt::print("  % of the errors within\n");
  print_curve("position", c.position, c.curves.position);
  print_curve("yaw", c.yaw, c.curves.yaw);
  print_curve("tilt", c.tilt, c.curves.tilt);
  print_curve("velocity", c.velocity, c.curves.velocity);
}

void print_text(const TrajectoryErrors& e, const std::string& align, std::size_t all) {
  fmt::print("poses      {} of {} with a reference, path length {:.2f} m\n", e.poses, all, e.path_length_m);
  fmt::print("error, m        rmse      mean    median       p95       max\n");
  print_summary("ATE " + align, e.ate(*alignment_from(align)));
  fmt::print("scale      {:+.3f} %\nyaw drift  {:+.3f} deg\n", 100 * e.scale_error, e.yaw_drift_deg);
  for (const RelativeError& r : e.rpe) {
    fmt::print("over {:>4.0f} m {:8.3f} % {:8.3f} deg  ({} pieces)\n", r.distance_m, r.translation_percent,
               r.rotation_deg, r.pairs);
  }
  for (const MotionError& m : e.motion) {
    fmt::print("over {:>4.0f} s {:8.4f} m {:8.3f} deg rms, {:.4f} m {:.3f} deg median, {:.4f} m {:.3f} deg 95 %\n",
               m.seconds, m.translation_m.rmse, m.rotation_deg.rmse, m.translation_m.median, m.rotation_deg.median,
               m.translation_m.p95, m.rotation_deg.p95);
  }
  if (e.nees.position) print_consistency(e.nees);
}

int evaluate_files(EvaluateArguments& options) {
  const auto odometry = read_odometry(options.estimate);
  if (!odometry) return report(odometry.error());
  const auto reference = read_trajectory(options.reference);
  if (!reference) return report(reference.error());
  const TrajectoryErrors errors = evaluate(odometry->trajectory, *reference, odometry->claims);
  if (errors.poses == 0) return report(no_common_time(options.estimate));
  if (options.json) {
    fmt::print("{}\n", evaluation_json(errors, options.align).dump(2));
  } else {
    print_text(errors, options.align, odometry->trajectory.poses.size());
  }
  return kExitDone;
}

}  // namespace

void add_evaluate(CLI::App& app, int& exit_code) {
  const auto [command, options] =
      add_command(app, exit_code, kAnalyse, "evaluate", "Compare a trajectory with a reference, and print its errors",
                  evaluate_files);
  command
      ->add_option("ESTIMATE", options->estimate,
                   "a replay's odometry.csv, a TUM trajectory or an ASL ground truth, may be gzipped")
      ->required();
  command->add_option("REFERENCE", options->reference, "ground truth, in either format")->required();
  command->add_option("--align", options->align, "how to align the estimate with the reference first")
      ->check(CLI::IsMember({"4dof", "se3", "sim3", "none"}))
      ->capture_default_str();
  command->add_flag("--json", options->json, "print the errors as JSON");
}

}  // namespace epiline
