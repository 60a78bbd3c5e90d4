#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "platform/linux/realtime.h"
#include "platform/time/monotonic.h"

namespace epiline {
namespace {

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

}  // namespace
}  // namespace epiline
