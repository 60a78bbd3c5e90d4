// Corrupt readings of the IMU: a flight with truth once undisturbed and once for each kind, size and time of a spike.
// How much worse is the flight, and does it say so?
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "tests/flights/spike_run.h"
#include "tests/flights/studies.h"

namespace epiline::spikes {
namespace {

struct Options {
  ReplayOptions replay;
  int times = 40;                      ///< single spikes, each in a flight of its own
  int seeds = 5;                       ///< flights with other times, axes and signs of each kind, size and rate
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

/// What several flights came to.
class Row {
 public:
  void add(const test::SpikeVerdict& v) {
    ate_.push_back(v.ate_m);
    tracking_ate_.push_back(v.tracking_ate_m);
    tracking_ += v.tracking_share;
    resets_ += v.resets;
    bridged_ += v.bridged;
    suspects_ += v.suspects;
    gaps_ += v.gaps;
  }

  double median() const { return sorted(ate_)[ate_.size() / 2]; }
  void print(const std::string& name, double undisturbed_m) const {
    const std::vector<double> ate = sorted(ate_);
    const double tracking = sorted(tracking_ate_)[ate.size() / 2];
    const auto n = static_cast<double>(ate.size());
    fmt::print("| {:24} | {:.4f} | {:.2f} | {:.2f} to {:.2f} | {:.4f} | {:3.0f} % | {} | {} / {} | {} | {} |\n", name,
               median(), median() / undisturbed_m, ate.front() / undisturbed_m, ate.back() / undisturbed_m, tracking,
               100 * tracking_ / n, resets_, bridged_, suspects_, gaps_,
               tracking <= 1.3 * undisturbed_m ? "" : "WRONG");
    std::fflush(stdout);
  }

 private:
  static std::vector<double> sorted(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v;
  }

  std::vector<double> ate_, tracking_ate_;
  double tracking_ = 0;
  std::uint64_t resets_ = 0, bridged_ = 0, suspects_ = 0, gaps_ = 0;
};

int run(const Options& o) {
  Row clean;
  for (int seed = 0; seed < std::max(1, o.seeds); ++seed) {
    const test::SpikeVerdict v = test::fly_with_spikes(o.replay, {}, static_cast<std::uint64_t>(seed));
    if (!v.ran || v.ate_m <= 0) {
      fmt::print(stderr, "no data set with ground truth\n");
      return 2;
    }
    clean.add(v);
  }
  fmt::print(
      "| spike | ATE, m (median) | times undisturbed | least to most | ATE of tracking, m (median) | tracking | resets "
      "| "
      "bridged / suspect | gaps | |\n|---|---|---|---|---|---|---|---|---|---|\n");
  clean.print("undisturbed", clean.median());
  std::vector<Case> list = cases();
  std::erase_if(list, [&](const Case& c) { return name_of(c).find(o.only) == std::string::npos; });
  if (list.empty()) return 0;
  std::mt19937_64 random(7);
  for (const Case& c : list) {
    for (const double rate : o.rates) {
      Row row;
      for (int seed = 1; seed <= o.seeds; ++seed) {
        std::vector<test::Spike> spikes;
        // not at the same time of every image's interval
        const double first_s = o.from_s + std::uniform_real_distribution<double>(0, 1 / rate)(random);
        for (double t = first_s; t < o.to_s; t += 1.0137 / rate) spikes.push_back({c.kind, c.size, t});
        row.add(test::fly_with_spikes(o.replay, spikes, static_cast<std::uint64_t>(seed)));
      }
      row.print(fmt::format("{}, {:g} a second", name_of(c), rate), clean.median());
    }
  }
  std::uniform_real_distribution<double> time(o.from_s, o.to_s);
  for (int i = 0; i < o.times; ++i) {
    const Case& c = list[static_cast<std::size_t>(i) % list.size()];
    const double at_s = time(random);
    Row row;
    row.add(test::fly_with_spikes(o.replay, {{c.kind, c.size, at_s}}, static_cast<std::uint64_t>(100 + i)));
    row.print(fmt::format("{} at {:.2f} s", name_of(c), at_s), clean.median());
  }
  return 0;
}

std::function<int()> add(CLI::App& app) {
  static Options o;
  app.add_option("DATASET", o.replay.dataset)->required();
  app.add_option("--times", o.times, "flights with a single spike")->capture_default_str();
  app.add_option("--seeds", o.seeds, "flights of each kind, size and rate")->capture_default_str();
  app.add_option("--rates", o.rates, "spikes a second")->capture_default_str();
  app.add_option("--from", o.from_s, "s after the first image")->capture_default_str();
  app.add_option("--to", o.to_s, "s after the first image")->capture_default_str();
  app.add_option("--only", o.only, "kinds and sizes with this in their name");
  app.add_option("--duration", o.replay.duration_s, "s of the flight");
  return [] { return run(o); };
}
const StudyEntry kEntry("spikes", "Corrupt readings of the IMU in a flight with ground truth", add);

}  // namespace
}  // namespace epiline::spikes
