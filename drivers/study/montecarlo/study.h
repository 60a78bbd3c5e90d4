#pragma once
// Many simulated flights: the errors of each visual factor, and whether its covariance tells the truth about them.
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "drivers/study/montecarlo/correlated_noise.h"
#include "drivers/study/montecarlo/simulated_run.h"
#include "platform/error/result.h"
#include "platform/math/statistics.h"

namespace epiline {

/// A visual factor and changes of its settings: `track`, `epipolar:gate:zero-motion`, `track:steps=5`.
struct FactorVariant {
  std::string name;
  VisualFactor factor = VisualFactor::kTrack;
  std::vector<std::string> changes;
};
/// The changes that parse_variant() understands, for a help text.
extern const char* const kVariantChanges;
/// Fails if and only if the factor or a change is unknown.
Result<FactorVariant> parse_variant(const std::string& text);

struct StudyOptions {
  std::vector<FlightKind> flights;
  std::vector<FactorVariant> variants;
  int runs = 20;  ///< of each flight, with the seeds `seed`, `seed` + 1, ...
  int jobs = 1;   ///< threads
  std::uint64_t seed = 1;
  TrackNoise noise{.pixel_sigma = 1, .outlier_share = 0.02, .drift_px = 0};
  CorrelatedNoise correlated;
  std::optional<double> assumed_sigma_px;  ///< the estimator's setting; none: the sigma of the white noise
  double time_offset_s = 0;                ///< of the images' timestamps; if not zero, the estimator estimates it
  double readout_s = 0;                    ///< of a rolling shutter
};

/// All runs of one flight with one variant, in the order of the seeds.
struct StudyCell {
  FlightKind flight;
  std::string variant;
  std::vector<RunFigures> runs;
};

/// Simulates each flight once for all variants, so that the factors get the same noise. All figures except the times
/// depend on the options only. The cells are in the order flight, variant; after an EndRequest, runs that were not
/// flown to their ends are left out, and cells without a run. Calls `progress` with finished and all flights, from one
/// thread at a time.
std::vector<StudyCell> run_study(const StudyOptions& options,
                                 const std::function<void(std::size_t, std::size_t)>& progress);

/// The figures of a cell, over the runs that did not diverge; the times are over all runs.
struct StudySummary {
  int diverged = 0, runs = 0;
  Summary ate, rpe, scale_abs, yaw, nees_position, nees_rotation, time_offset;
  double scale_mean = 0;
  Summary solve_ms, marginalise_ms, estimate_ms;
};
StudySummary summary_of(const StudyCell& cell);

}  // namespace epiline
