#include "platform/log/event_merge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "platform/memory/allocation_count.h"

namespace epiline {
namespace {

constexpr HostStamp kEnd{std::numeric_limits<std::int64_t>::max()};

// Against a stable sort of everything: one that comes at most the window too late finds its place.
TEST(EventMerge, PutsWhatComesLateWhereItBelongs) {
  constexpr std::int64_t kWindow = 100;
  std::mt19937 random(3);
  std::vector<Event> in;
  for (std::int64_t i = 0; i < 20000; ++i) {
    const auto late = static_cast<std::int64_t>(random() % kWindow);
    in.push_back({HostStamp{i / 3 - late}, EventId::kReset, {i, 0, 0}});
  }
  auto merge = std::make_unique<EventMerge<512>>();
  std::vector<Event> out;
  Event event;
  for (const Event& e : in) {
    ASSERT_TRUE(merge->add(e));
    const std::int64_t now = e.args[0] / 3;
    while (merge->take(HostStamp{now - kWindow}, event)) out.push_back(event);
  }
  EXPECT_GT(merge->size(), 0u);
  while (merge->take(kEnd, event)) out.push_back(event);
  std::stable_sort(in.begin(), in.end(), [](const Event& a, const Event& b) { return a.stamp < b.stamp; });
  ASSERT_EQ(out.size(), in.size());
  for (std::size_t i = 0; i < in.size(); ++i) ASSERT_EQ(out[i].args[0], in[i].args[0]) << i;
}

TEST(EventMerge, RefusesWhenFullAndUsesNoHeap) {
  auto merge = std::make_unique<EventMerge<4>>();
  const HeapCallScope heap;
  for (std::int64_t i = 0; i < 4; ++i) ASSERT_TRUE(merge->add({HostStamp{9 - i}, EventId::kReset, {}}));
  EXPECT_FALSE(merge->add({HostStamp{0}, EventId::kReset, {}}));
  Event event;
  EXPECT_FALSE(merge->take(HostStamp{5}, event));
  EXPECT_TRUE(merge->take(HostStamp{6}, event));
  EXPECT_EQ(event.stamp.ns, 6);
  EXPECT_TRUE(merge->add({HostStamp{0}, EventId::kReset, {}}));
  EXPECT_EQ(heap.calls(), 0);
}

}  // namespace
}  // namespace epiline
