// Camera or IMU silent in motion: flights with truth, in which each falls silent again and again, for 1 to 5 s at
// random times. Position and heading of the first pose after each silence against those of the last pose before it.
//
// What is judged is the change between the two poses, not the error in the world: that has gathered over the flight,
// and its covariance would hide the silence. Of the covariances published before (P1) and after (P2) the one of the
// change follows by how an error of the first state grows along the readings (tests/flights/silence_run.cc).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "platform/math/statistics.h"
#include "tests/flights/silence_run.h"
#include "tests/flights/studies.h"

namespace epiline::silence {
namespace {

constexpr double kSigmas = 3;
constexpr double kFirst_s = 15, kBetween_s = 8, kRandom_s = 5;  // s of flight before, between silences, and at random
constexpr double kMoving_m_s = 0.2;

struct Options {
  ReplayOptions replay;
  std::vector<std::filesystem::path> flights;
  int times = 3;  ///< silences of each kind in each flight
  std::uint64_t seed = 1;
  bool each = false;
};

struct Kind {
  bool of_imu = false;
  double seconds = 0;
  auto operator<=>(const Kind&) const = default;
};
constexpr std::array<Kind, 7> kKinds{{{false, 1}, {false, 2}, {false, 3}, {false, 5}, {true, 1}, {true, 2}, {true, 5}}};

/// Mean speed around a time, m/s; 0 where the truth does not reach.
double speed_at(const Trajectory& truth, HostStamp t) {
  TimedPose a, b;
  std::size_t hint = 0;
  const Span half = Span::from_milliseconds(500), gap = Span::from_milliseconds(300);
  if (!interpolate(truth, t - half, gap, a, hint) || !interpolate(truth, t + half, gap, b, hint)) return 0;
  return (b.p_WB - a.p_WB).norm() / (half + half).seconds();
}

/// A piece of a flight, and the silences in it.
struct Pass {
  double start_s = 0, duration_s = 0;
  std::vector<test::Silence> silences;
};

/// Deals the kinds out over as many pieces of the flight as it takes. A silence of the IMU ends its flight: place and
/// heading are so uncertain after it that a later silence would add nothing to that.
std::vector<Pass> plan(const AslDataset& dataset, int times, std::mt19937_64& random) {
  std::vector<Kind> camera, imu;
  for (const Kind& kind : kKinds)
    for (int i = 0; i < times; ++i) (kind.of_imu ? imu : camera).push_back(kind);
  std::shuffle(camera.begin(), camera.end(), random);
  std::uniform_real_distribution<double> share(0, 1);
  const HostStamp first = dataset.instant(0);
  const double length_s = (dataset.instant(dataset.instants_count() - 1) - first).seconds();
  std::vector<Pass> passes;
  while (!imu.empty()) {
    std::vector<Kind> kinds{imu.back()};
    imu.pop_back();
    const std::size_t of_camera = (camera.size() + imu.size()) / (imu.size() + 1);
    for (std::size_t i = 0; i < of_camera; ++i, camera.pop_back()) kinds.insert(kinds.begin(), camera.back());
    double most_s = kFirst_s;
    for (const Kind& kind : kinds) most_s += kind.seconds + kBetween_s + kRandom_s;
    Pass& pass = passes.emplace_back();
    pass.start_s = share(random) * std::max(0.0, length_s - most_s);
    double t = kFirst_s;
    for (const Kind& kind : kinds) {
      t += share(random) * kRandom_s;
      while (t < length_s &&
             speed_at(*dataset.ground_truth, first + Span::from_seconds(pass.start_s + t)) < kMoving_m_s)
        t += 0.5;
      pass.silences.push_back({kind.of_imu, t, kind.seconds});
      t += kind.seconds + kBetween_s;
    }
    pass.duration_s = t;
  }
  return passes;
}

struct Row {
  int n = 0, left_out = 0, resets = 0, position_covered = 0, heading_covered = 0, trusted = 0, never = 0;
  std::vector<double> position_m, heading_deg, position_sigma_m, heading_sigma_deg, position_nees, heading_nees,
      first_s, tracking_s;

  void add(const test::SilenceVerdict& v) {
    if (!v.judged) {
      ++left_out;
      return;
    }
    ++n;
    resets += v.reset;
    trusted += v.state == HealthState::kTracking;
    position_covered += v.position_error_m <= kSigmas * v.position_sigma_m;
    heading_covered += v.heading_error_deg <= kSigmas * v.heading_sigma_deg;
    position_m.push_back(v.position_error_m);
    heading_deg.push_back(v.heading_error_deg);
    position_sigma_m.push_back(v.position_sigma_m);
    heading_sigma_deg.push_back(v.heading_sigma_deg);
    position_nees.push_back(v.position_nees);
    heading_nees.push_back(v.heading_nees);
    first_s.push_back(v.first_pose_s);
    never += v.tracking_s < 0;
    if (v.tracking_s >= 0) tracking_s.push_back(v.tracking_s);
  }
};

double largest(const std::vector<double>& v) { return v.empty() ? 0 : *std::max_element(v.begin(), v.end()); }
double median(const std::vector<double>& v) { return v.empty() ? 0 : summarise(v).median; }

void print_head() {
  fmt::print(
      "| flight | silent | n (left out) | position off, median / max, m | claimed, median, m | heading off, median / "
      "max, "
      "deg | claimed, deg | within 3 sigma: position, heading | NEES, median: position, heading | resets | first pose "
      "after, median / max, s | tracking after, median / max, s (never) | called tracking at once |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
}

void print(const std::string& flight, const Kind& k, const Row& r) {
  fmt::print(
      "| {} | {} {:g} s | {} ({}) | {:.3f} / {:.3f} | {:.3f} | {:.2f} / {:.2f} | {:.2f} | {}/{}, {}/{} | {:.2f}, "
      "{:.2f} | "
      "{} | {:.2f} / {:.2f} | {:.1f} / {:.1f} ({}) | {} |\n",
      flight, k.of_imu ? "IMU" : "camera", k.seconds, r.n, r.left_out, median(r.position_m), largest(r.position_m),
      median(r.position_sigma_m), median(r.heading_deg), largest(r.heading_deg), median(r.heading_sigma_deg),
      r.position_covered, r.n, r.heading_covered, r.n, median(r.position_nees), median(r.heading_nees), r.resets,
      median(r.first_s), largest(r.first_s), median(r.tracking_s), largest(r.tracking_s), r.never, r.trusted);
  std::fflush(stdout);
}

void print_each(const std::string& flight, const test::SilenceVerdict& v) {
  fmt::print(
      "{} {} {:g} s at {:.2f} s: {}position {:.3f} m ({:.3f} claimed, NEES {:.2f}), heading {:.2f} deg "
      "({:.2f}, {:.2f}){}, first pose {:.2f} s, tracking {:.1f} s\n",
      flight, v.silence.of_imu ? "IMU" : "camera", v.silence.duration_s, v.silence.from_s,
      v.judged ? "" : "not judged, ", v.position_error_m, v.position_sigma_m, v.position_nees, v.heading_error_deg,
      v.heading_sigma_deg, v.heading_nees, v.reset ? ", reset" : "", v.first_pose_s, v.tracking_s);
  std::fflush(stdout);
}

int run(const Options& o) {
  std::map<Kind, Row> total;
  if (!o.each) print_head();
  for (const std::filesystem::path& flight : o.flights) {
    const auto dataset = open_asl_dataset(flight, o.replay.camera, {}, {});
    if (!dataset || !dataset->ground_truth) {
      fmt::print(stderr, "no data set with ground truth: {}\n", flight.string());
      return 2;
    }
    std::mt19937_64 random(o.seed);
    std::map<Kind, Row> rows;
    ReplayOptions replay = o.replay;
    replay.dataset = flight;
    for (const Pass& pass : plan(*dataset, o.times, random)) {
      replay.start_s = pass.start_s;
      replay.duration_s = pass.duration_s;
      for (const test::SilenceVerdict& v : test::fly_with_silences(replay, pass.silences)) {
        const Kind kind{v.silence.of_imu, v.silence.duration_s};
        rows[kind].add(v);
        total[kind].add(v);
        if (o.each) print_each(flight.filename().string(), v);
      }
    }
    if (o.each) print_head();
    for (const auto& [kind, row] : rows) print(flight.filename().string(), kind, row);
  }
  for (const auto& [kind, row] : total) print("all", kind, row);
  return 0;
}

std::function<int()> add(CLI::App& app) {
  static Options o;
  app.add_option("DATASETS", o.flights)->required();
  app.add_option("--times", o.times, "silences of each kind in each flight")->capture_default_str();
  app.add_option("--seed", o.seed, "of the times")->capture_default_str();
  app.add_flag("--each", o.each, "print every silence, too");
  return [] { return run(o); };
}
const StudyEntry kEntry("silence", "Silence of camera or IMU in flights with ground truth", add);

}  // namespace
}  // namespace epiline::silence
