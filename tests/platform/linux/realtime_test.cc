#include "platform/linux/realtime.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <cstdlib>
#include <cstring>
#include <memory>

#include "platform/memory/allocation_count.h"

namespace epiline {
namespace {

struct Seen {
  char name[16] = {};
  int policy = -1, priority = -1, cpus = 0, cpu = -1;
};

void look(void* context) {
  auto& seen = *static_cast<Seen*>(context);
  pthread_getname_np(pthread_self(), seen.name, sizeof seen.name);
  sched_param parameter{};
  pthread_getschedparam(pthread_self(), &seen.policy, &parameter);
  seen.priority = parameter.sched_priority;
  cpu_set_t set;
  pthread_getaffinity_np(pthread_self(), sizeof set, &set);
  seen.cpus = CPU_COUNT(&set);
  seen.cpu = sched_getcpu();
}

TEST(RealtimeThread, IsWhatWasAskedForOrSaysWhatIsMissing) {
  Seen seen;
  RealtimeThread thread;
  ASSERT_TRUE(thread.start({"epi-test-with-a-long-name", 10, 0}, look, &seen));
  thread.join();
  EXPECT_STREQ(seen.name, "epi-test-with-a");
  if (!thread.shortfall().priority) {
    EXPECT_EQ(seen.policy, SCHED_FIFO);
    EXPECT_EQ(seen.priority, 10);
  } else {
    EXPECT_EQ(seen.policy, SCHED_OTHER);
  }
  if (!thread.shortfall().cpu) {
    EXPECT_EQ(seen.cpus, 1);
    EXPECT_EQ(seen.cpu, 0);
  }
}

TEST(RealtimeThread, AProcessorThatIsNotThereIsAShortfall) {
  Seen seen;
  RealtimeThread thread;
  ASSERT_TRUE(thread.start({"test", 0, 100000}, look, &seen));
  thread.join();
  EXPECT_TRUE(thread.shortfall().cpu);
  EXPECT_FALSE(thread.shortfall().priority);
  EXPECT_EQ(seen.policy, SCHED_OTHER);
}

// The counters move when something happens, or a zero in a report would mean nothing.
TEST(ThreadCosts, SeeHeapCallsAndPageFaults) {
  const ThreadCosts before = costs_of_this_thread();
  constexpr std::size_t kBytes = 64 * 4096;
  const std::unique_ptr<char, void (*)(void*)> memory(static_cast<char*>(std::aligned_alloc(4096, kBytes)),
                                                      [](void* p) { std::free(p); });
  std::memset(memory.get(), 1, kBytes);
  const ThreadCosts cost = costs_of_this_thread() - before;
  EXPECT_GE(cost.page_faults, 32);
  if (allocation_counting_available()) {
    EXPECT_EQ(cost.heap_calls, 1);
  }
}

}  // namespace
}  // namespace epiline
