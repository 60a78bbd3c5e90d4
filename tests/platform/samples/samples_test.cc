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

TEST(Samples, NothingIsClaimedBeforeTheFirstEstimate) {
  const Odometry odometry;
  EXPECT_EQ(odometry.health.state, HealthState::kInitialising);
  EXPECT_EQ(odometry.health.quality, 0);
  EXPECT_EQ(odometry.q_WB, (std::array<double, 4>{1, 0, 0, 0})) << "a unit quaternion even when empty";
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
