#include <memory>
#include <string>

#include "drivers/laboratory/commands.h"
#include "drivers/laboratory/factors/visual_factors.h"
#include "drivers/program/cli/commands.h"

namespace epiline {

void add_comparing_replay(CLI::App& app, int& exit_code) {
  const auto factor = std::make_shared<std::string>("track");
  add_tuned_replay(app, exit_code, [factor](Config& config) { choose_visual_factor(*factor, config.estimator); })
      .add_option("--visual-factor", *factor, "visual factor: which residual a track becomes")
      ->check(CLI::IsMember(kVisualFactorNames))
      ->capture_default_str();
}

}  // namespace epiline
