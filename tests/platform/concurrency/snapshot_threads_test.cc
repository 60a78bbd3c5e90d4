#include "platform/concurrency/snapshot.h"

#include <gtest/gtest.h>

#include <array>
#include <thread>
#include <vector>

namespace epiline {
namespace {

struct Counted {
  std::array<std::uint64_t, 40> same{};
  std::uint8_t odd_size = 0;
};

TEST(SnapshotStress, ReadersSeeWholeValuesNeverOlderOnes) {
  Snapshot<Counted> snapshot;
  constexpr std::uint64_t kCount = 100000;
  std::array<std::uint64_t, 2> wrong{};
  std::vector<std::thread> readers;
  for (std::uint64_t& w : wrong) {
    readers.emplace_back([&snapshot, &w] {
      for (std::uint64_t last = 0; last < kCount;) {
        const Counted c = snapshot.read();
        for (const std::uint64_t n : c.same) w += n != c.same[0] ? 1U : 0U;
        if (c.same[0] < last || c.odd_size != static_cast<std::uint8_t>(c.same[0])) ++w;
        last = c.same[0];
      }
    });
  }
  Counted c;
  for (std::uint64_t n = 1; n <= kCount; ++n) {
    c.same.fill(n);
    c.odd_size = static_cast<std::uint8_t>(n);
    snapshot.write(c);
  }
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(wrong[0] + wrong[1], 0U);
}

TEST(Snapshot, HoldsItsDefaultFirst) {
  struct Value {
    int a = 7;
    double b = -1;
  };
  const Snapshot<Value> snapshot;
  EXPECT_EQ(snapshot.read().a, 7);
  EXPECT_EQ(snapshot.read().b, -1);
}

}  // namespace
}  // namespace epiline
