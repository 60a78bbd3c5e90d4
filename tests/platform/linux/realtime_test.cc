#include "platform/linux/realtime.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <thread>

#include "platform/memory/allocation_count.h"
#include "platform/time/monotonic.h"

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

// No right is needed for it.
TEST(RealtimeThread, RunsOnTheProcessorAskedFor) {
  cpu_set_t allowed;
  ASSERT_EQ(sched_getaffinity(0, sizeof allowed, &allowed), 0);
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (!CPU_ISSET(cpu, &allowed)) continue;
    Seen seen;
    RealtimeThread thread;
    ASSERT_TRUE(thread.start({"test", 0, cpu}, look, &seen));
    thread.join();
    EXPECT_FALSE(thread.shortfall().cpu) << cpu;
    EXPECT_EQ(seen.cpus, 1);
    EXPECT_EQ(seen.cpu, cpu);
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

struct Depth {
  std::size_t bytes = 0;
  ThreadCosts costs;
};

/// Uses so much of the stack.
void dive(void* context) {
  auto& depth = *static_cast<Depth*>(context);
  const ThreadCosts before = costs_of_this_thread();
  auto* const low = static_cast<volatile char*>(__builtin_alloca(depth.bytes));
  for (std::size_t i = 0; i < depth.bytes; ++i) low[i] = 1;
  depth.costs = costs_of_this_thread() - before;
}

#ifndef EPILINE_SANITIZED  // sanitizers have stacks of their own

TEST(RealtimeThreadDeathTest, AStackThatIsTooSmallEndsTheProgram) {
  const auto overrun = [] {
    Depth depth{1024 * 1024, {}};
    RealtimeThread thread;
    thread.start({.name = "test", .stack_bytes = 128 * 1024}, dive, &depth);
    thread.join();
  };
  EXPECT_EXIT(overrun(), testing::KilledBySignal(SIGSEGV), "");
}

TEST(RealtimeThread, TellsHowMuchOfItsStackWasUsed) {
  std::size_t before = 0;
  for (const std::size_t bytes : {std::size_t{16} * 1024, std::size_t{100} * 1024}) {
    Depth depth{bytes, {}};
    RealtimeThread thread;
    ASSERT_TRUE(thread.start({.name = "test", .stack_bytes = 256 * 1024}, dive, &depth));
    thread.join();
    EXPECT_GE(thread.stack_used(), bytes);
    EXPECT_LT(thread.stack_used(), bytes + 32 * 1024);
    EXPECT_GT(thread.stack_used(), before);
    EXPECT_LE(thread.stack_used(), thread.stack_bytes());
    before = thread.stack_used();
  }
}

TEST(RealtimeThread, NoPageOfItsStackIsFoundLater) {
  Depth depth{200 * 1024, {}};
  for (int run = 0; run < 2; ++run) {  // the first one finds the pages of the program
    RealtimeThread thread;
    ASSERT_TRUE(thread.start({.name = "test", .stack_bytes = 256 * 1024}, dive, &depth));
    thread.join();
  }
  EXPECT_EQ(depth.costs.page_faults, 0u);
}

#endif

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

TEST(ThreadCpu, CountsWorkAndNotTheWait) {
  const std::int64_t wall_ns = monotonic_ns(), cpu_ns = thread_cpu_ns();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_GE(monotonic_ns() - wall_ns, 50'000'000);
  EXPECT_LT(thread_cpu_ns() - cpu_ns, 25'000'000);
  volatile int work = 0;
  for (int i = 0; i < 5'000'000; ++i) work = work + 1;
  EXPECT_GT(thread_cpu_ns() - cpu_ns, 1'000'000) << "five million additions through memory";
}

TEST(ThreadCpu, IsOfTheCallingThreadAlone) {
  const std::int64_t cpu_ns = thread_cpu_ns();
  std::int64_t of_the_other_ns = 0;
  std::thread([&] {
    volatile int work = 0;
    for (int i = 0; i < 50'000'000; ++i) work = work + 1;
    of_the_other_ns = thread_cpu_ns();
  }).join();
  EXPECT_LT(thread_cpu_ns() - cpu_ns, of_the_other_ns);
}

// Four MiB of small pages that the kernel is free to join to huge ones.
void* small_pages(std::size_t bytes) {
  void* const at = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (at == MAP_FAILED) return nullptr;
  madvise(at, bytes, MADV_NOHUGEPAGE);
  std::memset(at, 1, bytes);
  madvise(at, bytes, MADV_HUGEPAGE);
  return at;
}

// While the kernel joins pages to a huge one, a thread that touches one of them has a page fault and waits.
TEST(LockMemory, PagesAreNotJoinedToHugeOnesAfterwards) {
  constexpr int kMadvCollapse = 25;  // linux/mman.h of Linux 6.1
  constexpr std::size_t kBytes = 4 << 20;
  enum Answer { kRefused, kJoined, kKernelCannot, kNotLocked };
  const pid_t child = fork();  // the memory of this process stays as it is
  ASSERT_GE(child, 0);
  if (child == 0) {
    void *const before = small_pages(kBytes), *const after = small_pages(kBytes);
    const bool can_be_kept = prctl(PR_GET_THP_DISABLE, 0, 0, 0, 0) == 0;  // not under qemu-user
    if (!can_be_kept || madvise(before, kBytes, kMadvCollapse) != 0) _exit(kKernelCannot);
    if (!lock_memory().empty()) _exit(kNotLocked);
    _exit(madvise(after, kBytes, kMadvCollapse) == 0 ? kJoined : kRefused);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == kKernelCannot)
    GTEST_SKIP() << "this kernel does not join pages on request, or cannot be kept from it";
  if (WEXITSTATUS(status) == kNotLocked) GTEST_SKIP() << "memory may not be locked here";
  EXPECT_EQ(WEXITSTATUS(status), kRefused);
}

}  // namespace
}  // namespace epiline
