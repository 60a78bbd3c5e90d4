#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <thread>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "drivers/study/montecarlo/study.h"
#include "drivers/study/montecarlo/study_report.h"
#include "pipeline/text/table.h"
#include "platform/linux/end_request.h"

namespace epiline {

namespace {

struct MontecarloArguments {
  StudyOptions study;
  std::vector<std::string> flights, factors;
  std::filesystem::path out;
  Foreign foreign = Foreign::kRefuse;
};

int montecarlo_command(MontecarloArguments& o) {
  o.study.flights.clear();
  for (const std::string& name : o.flights) o.study.flights.push_back(*flight_from(name));
  for (const std::string& text : o.factors) {
    auto variant = parse_variant(text);
    if (!variant) return report(variant.error());
    o.study.variants.push_back(std::move(*variant));
  }
  const auto folder = claim(o.out, {"montecarlo.txt", "montecarlo.json"}, o.foreign);
  if (!folder) return report(folder.error());
  if (const Status s = make_folder(o.out); !s) return report(s.error());
  ProgressBar bar(false, "flights");
  std::size_t flown = 0, wanted = 0;
  const EndRequest request;
  const auto cells = run_study(o.study, [&](std::size_t done, std::size_t all) {
    flown = done;
    wanted = all;
    bar(done, all);
  });
  if (cells.empty()) return report_ended(0, o.study.flights.size() * o.study.runs, "flights", "");
  const std::string text = study_text(cells, o.study);
  fmt::print("{}", text);
  if (const Status s = write_text(o.out / "montecarlo.txt", text); !s) return report(s.error());
  const Status s = write_text(o.out / "montecarlo.json", study_json(cells, o.study).dump(1) + "\n");
  if (!s) return report(s.error());
  return EndRequest::is_made() ? report_ended(flown, wanted, "flights", o.out.string()) : kExitDone;
}

void add_noise(CLI::App& command, StudyOptions& study) {
  command.add_option("--pixel-noise", study.noise.pixel_sigma, "white noise of the tracks, px")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_option("--outliers", study.noise.outlier_share, "share of outliers")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command.add_option("--drift", study.noise.drift_px, "random walk of the tracks, px per root of an image")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_option("--correlated-noise", study.correlated.sigma_px, "correlated noise of the tracks, px")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_option("--correlation-images", study.correlated.images, "correlation time of that noise, in images")
      ->check(CLI::Range(0.01, 1e6))
      ->capture_default_str();
  command
      .add_option("--assumed-sigma", study.assumed_sigma_px,
                  "noise that the estimator assumes, instead of the white noise, px")
      ->check(CLI::PositiveNumber);
  command.add_option("--time-offset", study.time_offset_s,
                     "unknown time offset, s: image timestamps are too early by this");
  command
      .add_option("--readout", study.readout_s, "rolling shutter: exposure of the last row minus that of the first, s")
      ->check(CLI::Range(-0.1, 0.1));
}

}  // namespace

void add_montecarlo(CLI::App& app, int& exit_code) {
  const auto o = std::make_shared<MontecarloArguments>();
  for (const FlightKind kind : kAllFlights)
    if (kind != FlightKind::kSurvey) o->flights.emplace_back(to_string(kind));  // two minutes, a study of its own
  o->factors.assign(kVisualFactorNames.begin(), kVisualFactorNames.end());
  o->study.jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  CLI::App* command =
      app.add_subcommand("montecarlo", "Simulate many flights, and compare the errors with the claimed covariance");
  command->group(kStudy);
  command->add_option("--flight", o->flights, "built-in flights")
      ->delimiter(',')
      ->check(CLI::IsMember(o->flights))
      ->capture_default_str();
  command
      ->add_option("--factors", o->factors,
                   std::string("visual factors, each optionally with changes after colons: ") + kVariantChanges)
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--runs", o->study.runs, "number of runs of each flight")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  add_noise(*command, o->study);
  command->add_option("--seed", o->study.seed, "seed of the first run")->capture_default_str();
  command->add_option("--jobs", o->study.jobs, "number of threads")->check(CLI::Range(1, 1024))->capture_default_str();
  command->add_option("--out", o->out, "folder for montecarlo.txt and montecarlo.json")->required();
  add_force(*command, o->foreign);
  command->callback([o, &exit_code] { exit_code = montecarlo_command(*o); });
}

}  // namespace epiline
