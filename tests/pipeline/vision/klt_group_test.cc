// Searches run in groups and keep their templates: neither may change a result by a bit.
#include <gtest/gtest.h>

#include <vector>

#include "tests/pipeline/vision/klt_tracks.h"

namespace epiline {
namespace {

void expect_same(const KltTrack& a, const KltTrack& b) {
  EXPECT_EQ(a.end, b.end) << "at " << a.x << ", " << a.y;
  EXPECT_EQ(a.found_x, b.found_x) << "at " << a.x << ", " << a.y;
  EXPECT_EQ(a.found_y, b.found_y) << "at " << a.x << ", " << a.y;
  EXPECT_EQ(a.correlation, b.correlation) << "at " << a.x << ", " << a.y;
}

// The searches run in groups; a track's result is its own all the same, also where others end early.
TEST(KltGroup, ATrackDoesNotDependOnItsNeighboursInTheList) {
  const Waves waves(21, 5, 40);
  const TestImage before = shifted(waves, 160, 120, 0, 0), now = shifted(waves, 160, 120, 3.2, -4.7, 0.7, 9);
  on_every_target([&] {
    auto together = grid_of_tracks(160, 120, 5, 7);
    for (std::size_t k = 0; k < together.size(); ++k) together[k].start_level = static_cast<int>(k * k % 5);
    const auto start = together;
    track({}, before, now, together);
    for (std::size_t k = 0; k < start.size(); ++k) {
      std::vector<KltTrack> alone{start[k]};
      track({}, before, now, alone);
      expect_same(together[k], alone[0]);
    }
  });
}

// Over three images: what the search for the second one leaves is the template that the third one needs.
TEST(KltGroup, AKeptPatchIsTheOneThatWouldBeMade) {
  const Waves waves(22, 5, 30);
  const TestImage images[] = {shifted(waves, 200, 160, 0, 0), shifted(waves, 200, 160, 1.3, 2.1, 0.8, 11),
                              shifted(waves, 200, 160, 4.6, 1.2, 1.1, -6)};
  on_every_target([&] {
    Pyramid pyramids[] = {{200, 160, 4}, {200, 160, 4}, {200, 160, 4}};
    for (int k = 0; k < 3; ++k) pyramids[k].build(images[k].view());
    auto tracks = grid_of_tracks(200, 160, 20, 9);
    std::vector<KltTemplate> patches(tracks.size());
    for (std::size_t k = 0; k < tracks.size(); ++k) tracks[k].patch = &patches[k];
    track_klt({}, pyramids[0].view(), pyramids[1].view(), tracks.data(), static_cast<int>(tracks.size()));
    std::erase_if(tracks, [](const KltTrack& t) { return t.end != KltEnd::kFound; });
    ASSERT_GT(tracks.size(), 150u);
    for (KltTrack& t : tracks) {
      t.x = t.found_x;
      t.y = t.found_y;
      t.start_level = 1;
      t.patch_known = true;
    }
    auto made = tracks;
    std::vector<KltTemplate> others(made.size());
    for (std::size_t k = 0; k < made.size(); ++k) {
      made[k].patch = &others[k];
      made[k].patch_known = false;
    }
    for (auto* list : {&tracks, &made}) {
      track_klt({}, pyramids[1].view(), pyramids[2].view(), list->data(), static_cast<int>(list->size()));
    }
    for (std::size_t k = 0; k < made.size(); ++k) expect_same(tracks[k], made[k]);
  });
}

}  // namespace
}  // namespace epiline
