// Corrupt readings in a recorded flight: it goes on as without them. tests/flights/spikes.cc tries many more.
#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "tests/flights/spike_run.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

TEST(CorruptReadings, OneASecondOfEachKindChangesNextToNothing) {
  ReplayOptions options;
  options.dataset = test::recorded_data("euroc_MH_01");
  if (!std::filesystem::exists(options.dataset)) GTEST_SKIP() << options.dataset << " is not here";
  options.duration_s = 12;
  const test::SpikeVerdict clean = test::fly_with_spikes(options, {}, 0);
  ASSERT_TRUE(clean.ran);
  ASSERT_EQ(clean.bridged, 0U);
  const test::Spike kinds[] = {{test::SpikeKind::kRate, 35}, {test::SpikeKind::kForce, 157}, {test::SpikeKind::kZeros}};
  for (std::uint64_t seed = 0; const test::Spike& kind : kinds) {
    std::vector<test::Spike> spikes;
    for (double t = 3; t < 11.5; t += 1.0137) spikes.push_back({kind.kind, kind.size, t});
    const test::SpikeVerdict v = test::fly_with_spikes(options, spikes, ++seed);
    SCOPED_TRACE(test::kSpikeKindNames[static_cast<std::size_t>(kind.kind)]);
    ASSERT_TRUE(v.ran);
    EXPECT_LT(v.ate_m, 1.3 * clean.ate_m);
    EXPECT_EQ(v.resets, 0U);
    if (kind.kind != test::SpikeKind::kZeros) {  // those are refused at the door
      EXPECT_EQ(v.bridged, spikes.size());
      EXPECT_GT(v.tracking_share, clean.tracking_share - 0.01);
    }
  }
}

}  // namespace
}  // namespace epiline
