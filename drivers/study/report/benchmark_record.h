#pragma once
// Many replays: each visual factor over each data set, some times over. What the tables of a benchmark are made of.
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "drivers/study/report/errors_json.h"
#include "drivers/study/report/program_info.h"
#include "pipeline/text/trajectory.h"

namespace epiline {

enum class RunOutcome {
  kDone,
  kNeverStarted,  ///< no pose in all the images
  kRefused,       ///< wrong data set or settings
  kFailed,        ///< crashed, or ended without its files
};
const char* to_string(RunOutcome outcome);

/// One replay.
struct BenchmarkRun {
  std::size_t dataset = 0, factor = 0;
  int repetition = 0;
  RunOutcome outcome = RunOutcome::kFailed;
  std::string message;  ///< one line, where the run is not done
  std::string folder;   ///< its results, relative to those of the benchmark
  Json stats;           ///< its stats.json; null: it left none
  Trajectory estimate;  ///< empty: none
};

struct BenchmarkDataset {
  std::string name;   ///< unique in the benchmark
  std::string group;  ///< the folder it lies in: data sets of a collection share a table
  std::string path;
  std::optional<Trajectory> truth;
};

struct BenchmarkRecord {
  ProgramInfo program;
  std::string processor, camera, config;
  int repeat = 1, jobs = 1;
  int ensemble = 0;  ///< above zero: the repetitions are perturbed, each in another way
  std::vector<std::string> factors;
  std::vector<BenchmarkDataset> datasets;
  std::vector<BenchmarkRun> runs;
};

/// A figure of stats.json that is compared.
struct BenchmarkFigure {
  const char* key;            ///< its name in benchmark.json
  const char* pointer;        ///< where stats.json has it; with a distance, where the entry of /error/rpe has it
  double rpe_distance_m = 0;  ///< 0: not one of the list
  bool magnitude = false;     ///< the sign is left out
  double motion_s = 0;        ///< as rpe_distance_m, of the list /error/motion
};
const std::vector<BenchmarkFigure>& benchmark_figures();

/// A figure over the runs that have it.
struct FigureSpread {
  double median = 0, lower_quartile = 0, upper_quartile = 0, least = 0, largest = 0;
};
FigureSpread spread_of(std::vector<double> values);  ///< at least one

/// One factor on one data set: the repetitions taken together.
struct BenchmarkCell {
  int runs = 0, done = 0;
  RunOutcome outcome = RunOutcome::kDone;  ///< of the first run that is not done, else done
  std::string message;
  bool diverged = false;                        ///< has_diverged() by some run's largest error
  bool identical = true;                        ///< all trajectories are the same to the last digit
  std::string folder;                           ///< of the first run
  const Trajectory* estimate = nullptr;         ///< of the first run that is done
  std::map<std::string, FigureSpread> spreads;  ///< by key; a figure that no run has is missing
  CalibrationCurves curves;                     ///< of all runs' poses
  /// The median.
  std::optional<double> figure(const std::string& key) const;
};

/// Cells in the order data set, factor.
std::vector<BenchmarkCell> cells_of(const BenchmarkRecord& record);

/// A factor's figure over that of another factor on the same data set: median, least and largest of the data sets where
/// both have one.
struct BenchmarkRatio {
  std::size_t datasets = 0;
  double median = 0, least = 0, largest = 0;
};

/// What the benchmark says as a whole.
class BenchmarkSummary {
 public:
  /// `record` must outlive it.
  explicit BenchmarkSummary(const BenchmarkRecord& record);
  const BenchmarkCell& cell(std::size_t dataset, std::size_t factor) const {
    return cells_[dataset * record_.factors.size() + factor];
  }
  /// The factor that the others are compared with: `track`, or the first.
  std::size_t baseline() const { return baseline_; }
  BenchmarkRatio ratio(std::size_t factor, const std::string& key) const;
  /// Of a factor's poses on all data sets.
  CalibrationCurves curves(std::size_t factor) const;
  /// A factor's figure on those of the data sets where every factor has it: only then means can be compared.
  std::vector<double> shared_values(const std::vector<std::size_t>& datasets, std::size_t factor,
                                    const std::string& key) const;

 private:
  const BenchmarkRecord& record_;
  std::vector<BenchmarkCell> cells_;
  std::size_t baseline_ = 0;
};

/// The groups in the order of their first data set, each with its data sets.
std::vector<std::pair<std::string, std::vector<std::size_t>>> groups_of(const BenchmarkRecord& record);

}  // namespace epiline
