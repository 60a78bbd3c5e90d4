#include "drivers/study/report/published_figures.h"

#include <algorithm>
#include <iterator>

namespace epiline {

namespace {

/// Song and Olivares-Mendez, "Structureless VIO", tables I and II, with VINS-Mono as measured there; Usenko et al.,
/// "Visual-Inertial Mapping with Non-Linear Factor Recovery" (basalt's odometry, two cameras); von Stumberg et al.,
/// "Direct Sparse Visual-Inertial Odometry using Dynamic Marginalization".
constexpr PublishedFigures kPublished[] = {{"MH_01_easy", 0.172, 0.157, 0.07, 0.06, 18.30, 39.27},
                                           {"MH_02_easy", 0.223, 0.181, 0.06, 0.04, 17.09, 38.96},
                                           {"MH_03_medium", 0.233, 0.196, 0.07, 0.12, 16.56, 39.90},
                                           {"MH_04_difficult", 0.257, 0.378, 0.13, 0.13, 15.57, 37.76},
                                           {"MH_05_difficult", 0.282, 0.303, 0.11, 0.12, 16.00, 38.56},
                                           {"V1_01_easy", 0.050, 0.082, 0.04, 0.06, 16.44, 39.22},
                                           {"V1_02_medium", 0.084, 0.112, 0.05, 0.07, 13.27, 33.54},
                                           {"V1_03_difficult", 0.103, 0.188, 0.10, 0.10, 10.84, 26.73},
                                           {"V2_01_easy", 0.078, 0.097, 0.04, 0.04, 16.66, 38.41},
                                           {"V2_02_medium", 0.116, 0.153, 0.05, 0.06, 13.50, 31.88},
                                           {"V2_03_difficult", 0.245, 0.298, 0, 0, 10.40, 20.87},
                                           {"room1", 0.051, 0.067, 0.09, 0, 11.56, 20.19},
                                           {"room2", 0.104, 0.068, 0.07, 0, 12.58, 22.67},
                                           {"room3", 0.114, 0.121, 0.13, 0, 11.89, 19.73},
                                           {"room4", 0.063, 0.048, 0.05, 0, 13.14, 21.03},
                                           {"room5", 0.127, 0.217, 0.13, 0, 11.27, 18.17},
                                           {"room6", 0.085, 0.076, 0.02, 0, 15.04, 26.24},
                                           {"corridor1", 0.398, 0.629, 0, 0, 11.46, 18.62},
                                           {"corridor2", 0.956, 0.933, 0, 0, 12.13, 19.06},
                                           {"corridor3", 0.893, 1.978, 0, 0, 10.98, 16.75},
                                           {"corridor4", 0.224, 0.315, 0, 0, 12.69, 19.92},
                                           {"corridor5", 0.456, 0.689, 0, 0, 12.36, 19.56}};

}  // namespace

const PublishedFigures* published_figures(const std::string& flight) {
  const auto* found =
      std::find_if(std::begin(kPublished), std::end(kPublished), [&](const auto& p) { return p.flight == flight; });
  return found != std::end(kPublished) ? found : nullptr;
}

}  // namespace epiline
