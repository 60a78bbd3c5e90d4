// Starts anywhere: a recorded flight begun every half second, six seconds each. How soon is there a pose, how good is
// it, does the health (docs/derivations/health.md) tell when it is not, does the covariance claimed in the first five
// seconds cover the errors (docs/derivations/consistency.md), and what does the start cost?
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/study/evaluate/errors.h"
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/flight_record.h"
#include "drivers/study/report/stats_json.h"
#include "tests/flights/studies.h"

namespace epiline::starts {
namespace {

constexpr double kGoodAte_m = 0.05, kGoodScale = 0.1;
constexpr Span kJudged = Span::from_milliseconds(5000);  // of each start, for the covariance

struct Options {
  ReplayOptions replay;
  int starts = 20;
  double every_s = 0.5;
};

struct Start {
  double at_s = 0;
  std::optional<double> first_pose_s;  ///< after the first image
  double ate_m = 0;                    ///< rms after alignment in yaw and translation
  double scale_error = 0;
  double claimed_wrongly_s = 0;              ///< health said tracking, and it was wrong
  Consistency nees = {};                     ///< over the first seconds
  double first_pose_ms = 0, refused_ms = 0;  ///< of the estimator: the frame that started, the slowest one before it
  bool good() const { return first_pose_s && ate_m < kGoodAte_m && std::abs(scale_error) < kGoodScale; }
};

/// Seconds of images reported as tracking whose position is off by more than 5 cm after alignment; all of them if the
/// scale is wrong.
double claimed_wrongly_s(const FlightRecord& record, double scale_error) {
  const Overlay o = overlay(trajectory_of(record), *record.truth);
  std::vector<const ImageRecord*> with_pose;
  for (const ImageRecord& image : record.images)
    if (image.has_pose) with_pose.push_back(&image);
  double seconds = 0;
  for (const PosePair& pair : o.pairs) {
    const std::size_t n = pair.index;
    const bool wrong =
        std::abs(scale_error) >= kGoodScale || (o.T(pair.estimate.p_WB) - pair.reference.p_WB).norm() > kGoodAte_m;
    if (n > 0 && wrong && with_pose[n]->health.state == HealthState::kTracking)
      seconds += (with_pose[n]->stamp - with_pose[n - 1]->stamp).seconds();
  }
  return seconds;
}

/// The record up to five seconds after the first pose.
Consistency first_seconds(FlightRecord record) {
  auto& images = record.images;
  const auto first = std::find_if(images.begin(), images.end(), [](const ImageRecord& i) { return i.has_pose; });
  const HostStamp end = first->stamp + kJudged;
  images.erase(std::find_if(first, images.end(), [&](const ImageRecord& i) { return i.stamp > end; }), images.end());
  return errors_of(record)->nees;
}

void take_times(const FlightRecord& record, Start& start) {
  for (const ImageRecord& image : record.images) {
    if (image.has_pose) {
      start.first_pose_ms = image.cpu_ms.estimate;
      return;
    }
    start.refused_ms = std::max(start.refused_ms, image.cpu_ms.estimate);
  }
}

Result<Start> start_at(const ReplayOptions& options) {
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result) return result.error();
  const FlightRecord& record = result->record;
  if (!record.truth)
    return Error{ErrorKind::kUsage, options.dataset.string(), 0, "no ground truth", "a recording with ground truth"};
  Start start{.at_s = options.start_s, .first_pose_s = start_seconds(record)};
  const auto errors = errors_of(record);
  if (!errors || errors->poses == 0) return start;
  start.ate_m = errors->ate_4dof.rmse;
  start.scale_error = errors->scale_error;
  start.claimed_wrongly_s = claimed_wrongly_s(record, start.scale_error);
  start.nees = first_seconds(record);
  take_times(record, start);
  return start;
}

void print_start(const Start& s) {
  if (!s.first_pose_s) {
    fmt::print("{:>7.2f} {:>12} {:>9} {:>9} {:>17}  no\n", s.at_s, "never", "-", "-", "-");
    return;
  }
  const auto nees = [](const std::optional<double>& v) { return v ? fmt::format("{:.2f}", *v) : std::string("-"); };
  fmt::print("{:>7.2f} {:>12.2f} {:>9.4f} {:>+9.2f} {:>17.2f} {:>6} {:>6} {:>6} {:>6} {:>7.2f} {:>7.2f}  {}\n", s.at_s,
             *s.first_pose_s, s.ate_m, 100 * s.scale_error, s.claimed_wrongly_s, nees(s.nees.position),
             nees(s.nees.velocity), nees(s.nees.tilt), nees(s.nees.yaw), s.first_pose_ms, s.refused_ms,
             s.good() ? "yes" : "no");
}

void print_consistency(const std::vector<Start>& starts) {
  using Figure = std::optional<double> Consistency::*;
  constexpr std::pair<const char*, Figure> kFigures[] = {{"position", &Consistency::position},
                                                         {"velocity", &Consistency::velocity},
                                                         {"tilt", &Consistency::tilt},
                                                         {"yaw", &Consistency::yaw}};
  fmt::print("\nNEES over the first 5 s, mean/median/worst of the starts:");
  for (const auto& [name, figure] : kFigures) {
    std::vector<double> values;
    for (const Start& s : starts)
      if (s.nees.*figure) values.push_back(*(s.nees.*figure));
    const Summary all = summarise(std::move(values));
    fmt::print(" {} {:.2f}/{:.2f}/{:.2f}", name, all.mean, all.median, all.max);
  }
  std::vector<double> first, refused;
  for (const Start& s : starts) {
    if (!s.first_pose_s) continue;
    first.push_back(s.first_pose_ms);
    refused.push_back(s.refused_ms);
  }
  const Summary f = summarise(first), r = summarise(refused);
  fmt::print("\nestimator, ms: frame that started, median/max {:.2f}/{:.2f}; slowest one before it {:.2f}/{:.2f}\n",
             f.median, f.max, r.median, r.max);
}

/// One line of the comparison.
struct Row {
  const char* name;
  int starts, good;
  const char *first_pose, *ate;
};

/// Measured on the same flight (EuRoC MH_01, its first 16 s), each system with its own EuRoC configuration and one
/// camera.
constexpr Row kOthers[] = {{"OpenVINS, dynamic start", 20, 20, "2.10/2.45", ".0071/.014"},
                           {"VINS-Mono, 10 Hz", 20, 19, "1.30/2.00", ".0066/5.6"},
                           {"VINS-Mono, 20 Hz", 20, 19, ".65/1.25", ".0068/.051"},
                           {"sqrtVINS, init, .25 s", 20, 18, ".35/.40", ".0098/1.0"},
                           {"sqrtVINS, srvins, .25 s", 20, 17, ".35/1.15", ".0079/2.1"},
                           {"LARVIO", 16, 12, "1.1/1.8", ".024/6.9"},
                           {"basalt, one camera", 20, 9, "0", ".093/2.4"}};

void print_row(const Row& row) {
  fmt::print("{:<26} {:>6} {:>5} {:>27} {:>20}\n", row.name, row.starts, row.good, row.first_pose, row.ate);
}

void print_comparison(const std::vector<Start>& starts) {
  std::vector<double> first, ate;
  int good = 0;
  double wrongly = 0;
  for (const Start& s : starts) {
    good += s.good();
    wrongly += s.claimed_wrongly_s;
    if (!s.first_pose_s) continue;
    first.push_back(*s.first_pose_s);
    ate.push_back(s.ate_m);
  }
  const Summary f = summarise(first), a = summarise(ate);
  fmt::print("\n{:<26} {:>6} {:>5} {:>27} {:>20}\n", "", "starts", "good", "first pose median/max, s",
             "ATE median/worst, m");
  const std::string first_text = fmt::format("{:.2f}/{:.2f}", f.median, f.max);
  const std::string ate_text = fmt::format("{:.4f}/{:.3f}", a.median, a.max);
  print_row({"epiline", static_cast<int>(starts.size()), good, first_text.c_str(), ate_text.c_str()});
  for (const Row& row : kOthers) print_row(row);
  fmt::print("\nreported as tracking while wrong: {:.2f} s in all\n", wrongly);
}

int run(const Options& options) {
  std::vector<Start> starts;
  fmt::print("{:>7} {:>12} {:>9} {:>9} {:>17} {:>27} {:>7} {:>7}  good\n", "start s", "first pose s", "ATE m",
             "scale %", "claimed wrongly s", "NEES pos    vel   tilt    yaw", "ms", "before");
  for (int i = 0; i < options.starts; ++i) {
    ReplayOptions replay_options = options.replay;
    replay_options.start_s += i * options.every_s;
    const auto start = start_at(replay_options);
    if (!start) {
      fmt::print(stderr, "epiline: error: {}\n", start.error().text());
      return start.error().kind == ErrorKind::kUsage ? 2 : 1;
    }
    starts.push_back(*start);
    print_start(*start);
    std::fflush(stdout);
  }
  print_comparison(starts);
  print_consistency(starts);
  return 0;
}

std::function<int()> add(CLI::App& app) {
  static Options o;
  o.replay.duration_s = 6;
  app.add_option("DATASET", o.replay.dataset, "ASL folder with ground truth")->required();
  app.add_option("--config", o.replay.config_file, "settings (TOML)");
  app.add_option("--starts", o.starts, "how many")->check(CLI::Range(1, 100'000))->capture_default_str();
  app.add_option("--every", o.every_s, "seconds between them")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--start", o.replay.start_s, "of the first one, s")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--duration", o.replay.duration_s, "of each, s")->check(CLI::PositiveNumber)->capture_default_str();
  return [] { return run(o); };
}
const StudyEntry kEntry(
    "starts", "A recorded flight started anywhere: how soon and how well, beside what other systems do on MH_01", add);

}  // namespace
}  // namespace epiline::starts
