#include "platform/time/backoff.h"

#include <gtest/gtest.h>

#include <vector>

namespace epiline {
namespace {

TEST(Backoff, TriesAtOnceThenAtGrowingIntervals) {
  Backoff backoff(Span{50}, Span{150});
  for (const std::int64_t lost_ns : {1'000, 20'000}) {
    backoff.begin(lost_ns);
    EXPECT_EQ(backoff.due_ns(), lost_ns);
    std::vector<std::int64_t> waits;
    for (std::int64_t now_ns = lost_ns; waits.size() < 4; now_ns += 1'000) {
      backoff.failed(now_ns);
      waits.push_back(backoff.due_ns() - now_ns);
    }
    EXPECT_EQ(waits, (std::vector<std::int64_t>{50, 100, 150, 150}));
  }
}

}  // namespace
}  // namespace epiline
