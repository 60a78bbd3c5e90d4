#include "platform/log/event.h"

#include <gtest/gtest.h>

#include <string>
#include <type_traits>

#include "platform/memory/allocation_count.h"
#include "platform/samples/samples.h"

namespace epiline {
namespace {

static_assert(std::is_trivially_copyable_v<Event>);

std::string formatted(const Event& event) {
  char text[128];
  const HeapCallScope heap;
  const std::size_t length = format_event(event, text);
  EXPECT_EQ(heap.calls(), 0);
  EXPECT_EQ(text[length], '\0');
  return {text, length};
}

TEST(Event, IsWrittenWithItsTimeNameAndArguments) {
  EXPECT_EQ(formatted({HostStamp{1'403'636'579'763'555'584}, EventId::kHealthChanged, {1, 2, 36}}),
            "1403636579.763555584 health_changed from=tracking to=degraded reasons=few_tracks+bias_implausible");
  EXPECT_EQ(formatted({HostStamp{5}, EventId::kReset, {3, 99, 99}}), "0.000000005 reset count=3");
  EXPECT_EQ(formatted({HostStamp{-1}, EventId::kImuGap, {7, 0, 0}}), "-0.000000001 imu_gap length_ns=7");
  EXPECT_EQ(formatted({HostStamp{0}, static_cast<EventId>(1000), {}}), "0.000000000 unknown id=1000");
  EXPECT_EQ(formatted({HostStamp{0}, EventId::kImagesFrozen, {0, 0, 0}}), "0.000000000 images_frozen on=0 images=0");
  EXPECT_EQ(formatted({HostStamp{0}, EventId::kClockJump, {0, -3, 0}}),
            "0.000000000 clock_jump source=camera correction_ns=-3");
}

TEST(Event, ShowsNamesWhereThereAreAnyAndNumbersWhereThereAreNone) {
  const auto reasons = [](std::int64_t bits) {
    return formatted({HostStamp{0}, EventId::kHealthChanged, {3, 4, bits}}).substr(12);
  };
  EXPECT_EQ(reasons(0), "health_changed from=lost to=4 reasons=none");
  EXPECT_EQ(reasons(static_cast<std::int64_t>(HealthReason::kNotFinite)),
            "health_changed from=lost to=4 reasons=not_finite");
  EXPECT_EQ(reasons((std::int64_t{1} << 40) + 1),
            "health_changed from=lost to=4 reasons=no_initial_state+1099511627776");
  EXPECT_EQ(formatted({HostStamp{0}, EventId::kImageDropped, {7, static_cast<std::int64_t>(ImageLoss::kMissed), 2}}),
            "0.000000000 image_dropped sequence=7 reason=missed images=2");
  EXPECT_EQ(formatted({HostStamp{0}, EventId::kImuRefused, {1, 2, -1}}),
            "0.000000000 imu_refused on=1 readings=2 reason=-1");
  EXPECT_EQ(formatted({HostStamp{0}, EventId::kRingOverflow, {static_cast<std::int64_t>(RingName::kEvents), 3, 0}}),
            "0.000000000 ring_overflow ring=events lost=3");
}

TEST(Event, IsCutToTheRoomThereIs) {
  const Event event{HostStamp{0}, EventId::kHealthChanged, {1, 2, 3}};
  for (std::size_t size = 1; size < 60; ++size) {
    std::string room(size + 1, '#');
    const std::size_t length = format_event(event, std::span(room.data(), size));
    EXPECT_LT(length, size);
    EXPECT_EQ(room[length], '\0');
    EXPECT_EQ(room[size], '#') << "wrote past the end";
  }
  EXPECT_EQ(format_event(event, {}), 0);
}

}  // namespace
}  // namespace epiline
