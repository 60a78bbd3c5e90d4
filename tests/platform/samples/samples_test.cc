#include "platform/samples/samples.h"

#include <gtest/gtest.h>

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

TEST(Samples, ReasonsAreDistinctBits) {
  const HealthReason all[] = {
      HealthReason::kNoInitialState,    HealthReason::kPosteriorWide,  HealthReason::kFewTracks,
      HealthReason::kManyGated,         HealthReason::kStepsRejected,  HealthReason::kBiasImplausible,
      HealthReason::kVelocityUncertain, HealthReason::kDeadlineMissed, HealthReason::kImuGap,
      HealthReason::kNotFinite};
  std::uint32_t combined = 0;
  for (const HealthReason reason : all) {
    EXPECT_EQ(combined & static_cast<std::uint32_t>(reason), 0u);
    combined |= static_cast<std::uint32_t>(reason);
  }
  EXPECT_EQ(combined, 2 * static_cast<std::uint32_t>(HealthReason::kNotFinite) - 1)
      << "a bit without a name, or this list is old";
}

}  // namespace
}  // namespace epiline
