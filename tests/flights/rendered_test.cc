// Rendered images against recorded ones: the tracker must have as hard a time with both.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <thread>

#include "drivers/laboratory/simulate/hybrid_flight.h"
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/stats_json.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

/// The block `tracks` of stats.json for the first seconds of a data set.
Json tracks_of(const std::filesystem::path& dataset, double duration_s) {
  ReplayOptions options;
  options.dataset = dataset;
  options.duration_s = duration_s;
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result) {
    ADD_FAILURE() << result.error().text();
    return {};
  }
  return stats_json(result->record, {}, {})["tracks"];
}

// The motion of MH_01 while it moves, rendered in a hall, gives tracks that live as long, scatter as much and are as
// many as those of the recorded images.
TEST(RenderedFlight, TracksAreLikeRecordedOnes) {
  if (std::getenv("EPILINE_NIGHTLY") == nullptr) GTEST_SKIP() << "a minute and more: for the night (EPILINE_NIGHTLY)";
  constexpr double kMoving_s = 15;
  const std::string recorded = test::recorded_data("euroc_MH_01");
  if (!std::filesystem::exists(recorded)) GTEST_SKIP() << recorded << " is not there";
  HybridSettings settings;
  settings.dataset = recorded;
  auto hybrid = hybrid_flight(settings);
  ASSERT_TRUE(hybrid) << hybrid.error().text();
  hybrid->flight.from_s += 0.9;  // the IMU's recording begins 1 s before the images'
  hybrid->flight.to_s = hybrid->flight.from_s + kMoving_s;
  const auto effects = parse_effects(kUsualEffects);
  ASSERT_TRUE(effects);
  const auto folder = std::filesystem::path(testing::TempDir()) / "epiline_rendered_like_recorded";
  const RenderChoice choice{.world = WorldKind::kHall,
                            .effects = *effects,
                            .seed = 1,
                            .jobs = static_cast<int>(std::thread::hardware_concurrency())};
  const Status rendered = render_flight(hybrid->flight, choice, folder, [](std::size_t, std::size_t) {});
  ASSERT_TRUE(rendered) << rendered.error().text();
  const Json is = tracks_of(folder, kMoving_s), should = tracks_of(recorded, kMoving_s);
  std::filesystem::remove_all(folder);
  for (const char* figure : {"per_image_mean", "length_mean", "noise_px"}) {
    const double ratio = is[figure].get<double>() / should[figure].get<double>();
    EXPECT_GT(ratio, 0.7) << figure << ": " << is << " against " << should;
    EXPECT_LT(ratio, 1.3) << figure << ": " << is << " against " << should;
    std::cout << figure << " rendered " << is[figure] << " recorded " << should[figure] << '\n';
  }
}

}  // namespace
}  // namespace epiline
