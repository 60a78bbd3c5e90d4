#include "platform/concurrency/lock_count.h"

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace epiline {
namespace {

class LockCount : public ::testing::Test {
 protected:
  void SetUp() override {
#ifdef EPILINE_SANITIZED
    GTEST_SKIP() << "a sanitizer owns the locks: they are not counted";
#else
    ASSERT_TRUE(lock_counting_available());
#endif
  }
};

template <class Act>
std::uint64_t lock_calls_of(Act&& act) {
  const std::uint64_t before = lock_calls_of_this_thread();
  act();
  return lock_calls_of_this_thread() - before;
}

TEST_F(LockCount, EachKindCountsOnThisThreadOnly) {
  std::mutex mutex;
  EXPECT_EQ(lock_calls_of([&] { const std::lock_guard hold(mutex); }), 1);
  EXPECT_EQ(lock_calls_of([&] { ASSERT_TRUE(mutex.try_lock()); }), 1);
  mutex.unlock();
  std::uint64_t of_other = 0;
  EXPECT_EQ(lock_calls_of([&] {
              std::thread([&] { of_other = lock_calls_of([&] { const std::lock_guard hold(mutex); }); }).join();
            }),
            0);
  EXPECT_EQ(of_other, 1);
}

// By the steady clock and by the system's: the C library has a function for each.
TEST_F(LockCount, EachLockAndWaitWithATimeCountsOnce) {
  const auto steady = [] { return std::chrono::steady_clock::now() + std::chrono::milliseconds(1); };
  const auto system = [] { return std::chrono::system_clock::now() + std::chrono::milliseconds(1); };
  std::timed_mutex timed;
  EXPECT_EQ(lock_calls_of([&] { ASSERT_TRUE(timed.try_lock_until(steady())); }), 1);
  timed.unlock();
  EXPECT_EQ(lock_calls_of([&] { ASSERT_TRUE(timed.try_lock_until(system())); }), 1);
  timed.unlock();
  std::mutex mutex;
  std::condition_variable condition;
  std::unique_lock<std::mutex> hold(mutex);
  EXPECT_EQ(lock_calls_of([&] { condition.wait_until(hold, steady()); }), 1);
  EXPECT_EQ(lock_calls_of([&] { condition.wait_until(hold, system()); }), 1);
}

TEST_F(LockCount, WaitingForAConditionCounts) {
  std::mutex mutex;
  std::condition_variable condition;
  std::unique_lock<std::mutex> hold(mutex);
  std::thread other([&] {
    const std::lock_guard<std::mutex> inside(mutex);
    condition.notify_one();
  });
  const std::uint64_t calls = lock_calls_of([&] { condition.wait(hold); });
  EXPECT_GE(calls, 1);
  EXPECT_LE(calls, 100) << "it may wake without a reason";
  hold.unlock();
  other.join();
}

}  // namespace
}  // namespace epiline
