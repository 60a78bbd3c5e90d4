#include "platform/time/clock.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <concepts>
#include <type_traits>

namespace epiline {
namespace {

// What must not compile: instants of two clocks in one expression, and arithmetic that has no meaning.
template <class A, class B>
concept Subtractable = requires(A a, B b) {
  a - b;
};
template <class A, class B>
concept Addable = requires(A a, B b) {
  a + b;
};
template <class A, class B>
concept Comparable = requires(A a, B b) {
  a < b;
};
static_assert(Subtractable<HostStamp, HostStamp> && !Subtractable<HostStamp, DeviceStamp>);
static_assert(Comparable<HostStamp, HostStamp> && !Comparable<HostStamp, DeviceStamp>);
static_assert(Addable<HostStamp, Span> && !Addable<HostStamp, HostStamp>);
static_assert(!std::is_convertible_v<HostStamp, DeviceStamp> && !std::is_convertible_v<std::int64_t, HostStamp>);

TEST(Clock, SpansRoundToTheNearestNanosecond) {
  EXPECT_EQ(Span::from_seconds(1.5).ns, 1'500'000'000);
  EXPECT_EQ(Span::from_seconds(-1.5).ns, -1'500'000'000);
  EXPECT_EQ(Span::from_seconds(0.1).ns, 100'000'000);
  EXPECT_EQ(Span::from_seconds(-0.6e-9).ns, -1);
  EXPECT_EQ(Span::from_milliseconds(-3).ns, -3'000'000);
  EXPECT_DOUBLE_EQ(Span{250'000'000}.seconds(), 0.25);
}

TEST(Clock, StampsKeepNanosecondsAtTodaysDates) {
  const HostStamp a{1'403'636'579'763'555'584};  // beyond what a double resolves
  EXPECT_EQ(((a + Span{1}) - a).ns, 1);
  EXPECT_LT(a, a + Span{1});
}

RC_GTEST_PROP(Clock, StampsAndSpansFormAnAffineLine, ()) {
  const auto number = rc::gen::inRange<std::int64_t>(-4'000'000'000'000'000'000, 4'000'000'000'000'000'000);
  const HostStamp a{*number};
  const Span d{*number};
  RC_ASSERT((a + d) - a == d);
  RC_ASSERT((a + d) - d == a);
  RC_ASSERT(a - (a + d) == -d);
  RC_ASSERT((a < a + d) == (d > Span{}));
}

}  // namespace
}  // namespace epiline
