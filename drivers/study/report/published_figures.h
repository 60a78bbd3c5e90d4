#pragma once
// What others published for whole recorded flights, beside which the benchmark puts its own figures.
#include <string>

namespace epiline {

/// Position error, rms after alignment, m; mean time of a solve, ms. Zero: not published.
struct PublishedFigures {
  const char* flight;  ///< the folder that `./run data` makes
  double paper_m, vins_m, basalt_m, vi_dso_m;
  double paper_ms, vins_ms;
};

/// Nullptr: none for a flight of this name.
const PublishedFigures* published_figures(const std::string& flight);

}  // namespace epiline
