#include "platform/samples/samples.h"

#include <gtest/gtest.h>

#include <bit>
#include <set>
#include <string_view>
#include <type_traits>

namespace epiline {
namespace {

// Samples travel through rings and binary logs: copying one must be copying bytes.
template <class... Ts>
constexpr bool kPlain = (... && (std::is_trivially_copyable_v<Ts> && std::is_standard_layout_v<Ts> &&
                                 std::is_nothrow_default_constructible_v<Ts>));
static_assert(kPlain<ImuSample, WheelSample, Frame, TrackedFeature, TrackedFrame, Health, Odometry>);

TEST(Samples, NoCameraReachesAnothersTracks) {
  for (std::size_t camera = 0; camera <= kMostOthers; ++camera) {
    const std::uint32_t first = first_track_of(camera);
    for (const std::uint32_t before : {0U, 1U, kTrackIds - 1, kTrackIds, kTrackIds + 1, ~0U}) {
      EXPECT_GE(track_id(first, before), first) << before;
      EXPECT_LT(track_id(first, before) - first, kTrackIds) << before;
    }
    EXPECT_EQ(track_id(first, kTrackIds + 5), first + 5);
  }
}

TEST(Samples, EveryReasonHasANameOfItsOwn) {
  const std::set<std::string_view> names(kHealthReasonNames.begin(), kHealthReasonNames.end());
  EXPECT_EQ(names.size(), static_cast<std::size_t>(kHealthReasons));
  EXPECT_STREQ(kHealthReasonNames[static_cast<std::size_t>(std::countr_zero(bit(HealthReason::kNotFinite)))],
               "not_finite");
  EXPECT_STREQ(kHealthReasonNames[static_cast<std::size_t>(std::countr_zero(bit(HealthReason::kOverloaded)))],
               "overloaded");
  EXPECT_EQ(bit(HealthReason::kNumbersWrong), 1U << (kHealthReasons - 1)) << "a bit without a name";
  EXPECT_STREQ(kHealthStateNames[static_cast<std::size_t>(HealthState::kLost)], "lost");
}

}  // namespace
}  // namespace epiline
