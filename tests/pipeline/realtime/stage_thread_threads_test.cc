// The one loop that carries every stage. Run under the thread sanitizer too.
#include "pipeline/realtime/stage_thread.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <limits>
#include <thread>

#include "platform/concurrency/spsc_ring.h"

namespace epiline {
namespace {

void wait_until(const std::atomic<int>& counter, int least) {
  while (counter < least) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

constexpr std::int64_t kNever_ns = std::numeric_limits<std::int64_t>::max();

/// Takes numbers, one a step, and sleeps without a time-out while there is none.
class Taker final : public Stage {
 public:
  Step step() noexcept override {
    const bool over = input_ended.is_set();
    ++steps;
    int number = 0;
    if (!input.pop(number)) return over ? Step::end() : Step::nothing_until(sleep_until_ns);
    sum += number;
    return Step::work();
  }
  bool ready() noexcept override { return input.front() != nullptr || input_ended.is_set(); }

  SpscRing<int, 64> input;
  EndMark input_ended;
  std::int64_t sleep_until_ns = kNever_ns;
  std::atomic<int> steps{0}, sum{0};
};

class StageThreadTest : public testing::Test {
 protected:
  void start() { ASSERT_TRUE(thread.start(taker)); }
  FlightSwitch flight;
  Taker taker;
  StageThread thread{{"t"}, flight};
};

TEST_F(StageThreadTest, DoesNothingBeforeTheFlightIsArmed) {
  taker.input.push(1);
  start();
  for (int i = 0; i < 20; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(taker.steps, 0);
  flight.stop();
  thread.join();
  EXPECT_EQ(taker.steps, 0);
  EXPECT_TRUE(thread.ended().is_set());
}

TEST_F(StageThreadTest, WakesForWhatItIsGivenAndEndsWithItsStage) {
  start();
  flight.arm();
  for (int i = 1; i <= 1000; ++i) {
    while (!taker.input.push(1)) std::this_thread::yield();
    thread.parking().notify();
    if (i % 100 == 0) wait_until(taker.sum, i);  // it sleeps without a time-out: only a notification wakes it
  }
  EXPECT_FALSE(thread.ended().is_set());
  taker.input_ended.set();
  thread.parking().notify();
  thread.join();
  EXPECT_TRUE(thread.ended().is_set());
  EXPECT_EQ(taker.sum, 1000);
}

TEST_F(StageThreadTest, StepsAgainAtTheTimeThatItsStageSays) {
  taker.sleep_until_ns = 0;  // long past
  start();
  flight.arm();
  wait_until(taker.steps, 10);
  flight.stop();
  thread.join();
}

TEST_F(StageThreadTest, AStopWakesASleeperAndLeavesWhatIsLeft) {
  start();
  flight.arm();
  wait_until(taker.steps, 1);
  flight.stop();
  thread.join();
  EXPECT_TRUE(thread.ended().is_set()) << "readers of it would wait for ever";
}

TEST(StageThread, OneThatGoesOnEndsAfterThoseBeforeIt) {
  FlightSwitch flight;
  Taker taker;
  StageThread thread({"t"}, flight, StageThread::AtStop::kGoOn);
  ASSERT_TRUE(thread.start(taker));
  flight.arm();
  flight.stop();
  taker.input.push(5);
  thread.parking().notify();
  wait_until(taker.sum, 5);
  EXPECT_FALSE(thread.ended().is_set());
  taker.input_ended.set();
  flight.notify_all();
  thread.join();
  EXPECT_TRUE(thread.ended().is_set());
}

}  // namespace
}  // namespace epiline
