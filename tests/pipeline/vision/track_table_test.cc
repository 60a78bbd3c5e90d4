#include "pipeline/vision/track_table.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <set>

namespace epiline {
namespace {

// Tracks come and go; each keeps its place for a patch, and no two have the same.
TEST(TrackTable, EveryTrackKeepsAPatchOfItsOwn) {
  const auto table = std::make_unique<TrackTable>();
  const auto alive = std::make_unique<TrackTable::Column<bool>>();
  std::mt19937 random(1);
  constexpr int kMost = 50;
  std::map<std::uint32_t, int> patch_of;
  std::uint32_t next_id = 0;
  for (int round = 0; round < 200; ++round) {
    for (int wanted = static_cast<int>(random() % (kMost + 1)); table->size < wanted; ++table->size) {
      table->id[table->size] = next_id;
      patch_of[next_id++] = table->patch[table->size];
    }
    std::set<int> used;
    for (int i = 0; i < table->size; ++i) {
      EXPECT_EQ(table->patch[i], patch_of[table->id[i]]) << "track " << table->id[i];
      EXPECT_TRUE(used.insert(table->patch[i]).second) << "place " << table->patch[i] << " twice";
      EXPECT_LT(table->patch[i], kMost);
      (*alive)[i] = random() % 4 != 0;
    }
    table->keep(*alive);
  }
}

}  // namespace
}  // namespace epiline
