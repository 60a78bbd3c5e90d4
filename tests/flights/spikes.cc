// Corrupt readings of the IMU: a flight with truth once undisturbed and once for each kind, size and time of a spike.
// How much worse is the flight, and does it say so?
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "tests/flights/spike_run.h"

namespace epiline {
namespace {

struct Options {
  ReplayOptions replay;
  int times = 40;                      ///< single spikes, each in a flight of its own
  std::vector<double> rates = {1, 5};  ///< spikes a second
  double from_s = 3, to_s = 28;
  std::string only;
};

struct Case {
  test::SpikeKind kind;
  double size = 0;
};

std::vector<Case> cases() {
  std::vector<Case> list;
  for (const double size : {2., 5., 10., 35., 90., 300.}) list.push_back({test::SpikeKind::kRate, size});
  for (const double size : {5., 15., 30., 60., 157., 300., 2000.}) list.push_back({test::SpikeKind::kForce, size});
  list.push_back({test::SpikeKind::kZeros});
  list.push_back({test::SpikeKind::kStuck});
  return list;
}

std::string name_of(const Case& c) {
  const char* name = test::kSpikeKindNames[static_cast<std::size_t>(c.kind)];
  return c.size > 0 ? fmt::format("{} {:g}", name, c.size) : name;
}

void print(const std::string& name, const test::SpikeVerdict& v, double undisturbed_m) {
  const bool good = v.tracking_ate_m <= 1.3 * undisturbed_m;
  fmt::print("| {:24} | {:.4f} | {:.2f} | {:.4f} | {:3.0f} % | {} | {} / {} | {} | {} |\n", name, v.ate_m,
             v.ate_m / undisturbed_m, v.tracking_ate_m, 100 * v.tracking_share, v.resets, v.bridged, v.suspects, v.gaps,
             good ? "" : "WRONG");
  std::fflush(stdout);
}

int run(const Options& o) {
  const test::SpikeVerdict clean = test::fly_with_spikes(o.replay, {}, 0);
  if (!clean.ran || clean.ate_m <= 0) {
    fmt::print(stderr, "no data set with ground truth\n");
    return 2;
  }
  fmt::print(
      "| spike | ATE, m | times undisturbed | ATE of tracking, m | tracking | resets | bridged / suspect | gaps | |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  print("undisturbed", clean, clean.ate_m);
  std::uint64_t seed = 1;
  std::vector<Case> list = cases();
  std::erase_if(list, [&](const Case& c) { return name_of(c).find(o.only) == std::string::npos; });
  if (list.empty()) return 0;
  for (const Case& c : list) {
    for (const double rate : o.rates) {
      std::vector<test::Spike> spikes;
      // not at the same time of every image's interval
      for (double t = o.from_s; t < o.to_s; t += 1.0137 / rate) spikes.push_back({c.kind, c.size, t});
      print(fmt::format("{}, {:g} a second", name_of(c), rate), test::fly_with_spikes(o.replay, spikes, ++seed),
            clean.ate_m);
    }
  }
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> time(o.from_s, o.to_s);
  for (int i = 0; i < o.times; ++i) {
    const Case& c = list[static_cast<std::size_t>(i) % list.size()];
    const double at_s = time(random);
    print(fmt::format("{} at {:.2f} s", name_of(c), at_s),
          test::fly_with_spikes(o.replay, {{c.kind, c.size, at_s}}, ++seed), clean.ate_m);
  }
  return 0;
}

}  // namespace
}  // namespace epiline

int main(int argc, char** argv) {
  epiline::Options options;
  CLI::App app("Corrupt readings of the IMU in a flight with ground truth");
  app.add_option("DATASET", options.replay.dataset)->required();
  app.add_option("--times", options.times, "flights with a single spike")->capture_default_str();
  app.add_option("--rates", options.rates, "spikes a second")->capture_default_str();
  app.add_option("--from", options.from_s, "s after the first image")->capture_default_str();
  app.add_option("--to", options.to_s, "s after the first image")->capture_default_str();
  app.add_option("--only", options.only, "kinds and sizes with this in their name");
  app.add_option("--duration", options.replay.duration_s, "s of the flight");
  CLI11_PARSE(app, argc, argv);
  return epiline::run(options);
}
