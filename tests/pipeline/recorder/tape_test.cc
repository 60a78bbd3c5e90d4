#include "pipeline/recorder/tape.h"

#include <gtest/gtest.h>

#include <vector>

#include "platform/memory/allocation_count.h"

namespace epiline {
namespace {

constexpr std::size_t kSegments = 8, kKept = 6, kBytes = 64;  // four numbers in a segment

std::vector<std::uint64_t> numbers(const Tape& tape, Tape::Range range) {
  std::vector<std::uint64_t> found;
  for (std::uint64_t s = range.from; s < range.to; ++s) {
    tape.each(s, [&](const Tape::Record& record) {
      EXPECT_EQ(record.kind, 7u);
      ASSERT_EQ(record.bytes.size(), sizeof(std::uint64_t));
      found.push_back(0);
      std::memcpy(&found.back(), record.bytes.data(), sizeof(std::uint64_t));
    });
  }
  return found;
}

void expect_run(const std::vector<std::uint64_t>& found, std::uint64_t first, std::uint64_t last) {
  ASSERT_EQ(found.size(), last - first + 1);
  for (std::size_t i = 0; i < found.size(); ++i) ASSERT_EQ(found[i], first + i);
}

TEST(Tape, KeepsTheNewest) {
  Tape tape(kSegments, kKept, kBytes);
  for (std::uint64_t i = 0; i < 10; ++i) ASSERT_TRUE(tape.append(7, i));
  expect_run(numbers(tape, tape.lend()), 0, 9);
  tape.done();
  for (std::uint64_t i = 10; i < 1000; ++i) ASSERT_TRUE(tape.append(7, i));
  const auto found = numbers(tape, tape.lend());
  expect_run(found, 1000 - found.size(), 999);
  EXPECT_GT(found.size(), (kKept - 1) * 4);
  EXPECT_LE(found.size(), kKept * 4);
  EXPECT_EQ(tape.lost(), 0u);
}

// What is lent stays as it is; recording has the other segments, then loses, then has what was given back.
TEST(Tape, NeverWritesOverWhatIsLent) {
  Tape tape(kSegments, kKept, kBytes);
  std::uint64_t next = 0;
  while (next < 100) ASSERT_TRUE(tape.append(7, next++));
  const Tape::Range range = tape.lend();
  const auto before = numbers(tape, range);
  std::uint64_t taken = 0;
  while (tape.append(7, next)) ++next, ++taken;
  EXPECT_EQ(taken, (kSegments - kKept) * 4);
  EXPECT_EQ(tape.lost(), 1u);
  EXPECT_EQ(numbers(tape, range), before);
  tape.done_before(range.from + 1);  // one segment is free again
  taken = 0;
  while (tape.append(7, next)) ++next, ++taken;
  EXPECT_EQ(taken, 4u);
  EXPECT_EQ(numbers(tape, {range.from + 1, range.to}), (std::vector(before.begin() + 4, before.end())));
  tape.done();
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(tape.append(7, next++));
  const auto found = numbers(tape, tape.lend());
  expect_run(found, next - found.size(), next - 1);
}

TEST(Tape, RecordsOfAllSizesAndNoneTooLarge) {
  Tape tape(kSegments, kKept, kBytes);
  for (std::size_t size = 0; size <= kBytes - 8; ++size) {
    std::byte* const room = tape.claim(static_cast<std::uint32_t>(size), size);
    ASSERT_NE(room, nullptr) << size;
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(room) % 8, 0u);
    for (std::size_t i = 0; i < size; ++i) room[i] = static_cast<std::byte>(size);
    tape.commit();
  }
  EXPECT_EQ(tape.claim(0, kBytes - 7), nullptr);
  EXPECT_EQ(tape.lost(), 1u);
  const Tape::Range range = tape.lend();
  std::size_t last = 0;
  for (std::uint64_t s = range.from; s < range.to; ++s) {
    tape.each(s, [&](const Tape::Record& r) {
      last = r.bytes.size();
      EXPECT_EQ(r.kind, last);
      for (const std::byte b : r.bytes) ASSERT_EQ(b, static_cast<std::byte>(last));
    });
  }
  EXPECT_EQ(last, kBytes - 8);
}

TEST(Tape, ARecordThatWasNotCommittedIsNotThere) {
  Tape tape(kSegments, kKept, kBytes);
  ASSERT_TRUE(tape.append(7, std::uint64_t{0}));
  ASSERT_NE(tape.claim(9, 8), nullptr);
  ASSERT_TRUE(tape.append(7, std::uint64_t{1}));
  expect_run(numbers(tape, tape.lend()), 0, 1);
}

TEST(Tape, UsesNoHeap) {
  Tape tape(kSegments, kKept, kBytes);
  const HeapCallScope heap;
  for (std::uint64_t i = 0; i < 1000; ++i) tape.append(7, i);
  tape.lend();
  EXPECT_EQ(heap.calls(), 0);
}

}  // namespace
}  // namespace epiline
