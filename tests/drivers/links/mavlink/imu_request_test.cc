#include "drivers/links/mavlink/imu_request.h"
#include "tests/support/times.h"

#include <gtest/gtest.h>

namespace epiline::mavlink {
namespace {

constexpr Address kUs{1, 197}, kPilot{1, 1};

TEST(MavlinkImuRequest, AsksForTheInterval) {
  ImuRequest request(200);
  EXPECT_EQ(request.due_ns(), 0);
  const CommandLong command = request.question(kPilot, 5 * kSecond);
  EXPECT_EQ(command.command, 511);  // MAV_CMD_SET_MESSAGE_INTERVAL
  EXPECT_EQ(command.param1, 105);
  EXPECT_EQ(command.param2, 5000);
  EXPECT_EQ(command.target_system, 1);
  EXPECT_EQ(command.target_component, 1);
  EXPECT_EQ(command.confirmation, 0);
  EXPECT_EQ(request.due_ns(), 6 * kSecond);
  EXPECT_EQ(request.question(kPilot, 6 * kSecond).confirmation, 1);
}

TEST(MavlinkImuRequest, IsDoneWhenReadingsCome) {
  ImuRequest request(200);
  request.question(kPilot, 5 * kSecond);
  request.receive({.command = 511, .result = 0}, kUs, 5 * kSecond);
  EXPECT_EQ(request.state(), RequestState::kAccepted);
  for (std::int64_t s = 5; s < 100; ++s) {
    request.reading(s * kSecond);
    EXPECT_GT(request.due_ns(), (s + 1) * kSecond);
  }
  // it starts anew, and has forgotten
  EXPECT_EQ(request.due_ns(), 101 * kSecond);
  EXPECT_EQ(request.question(kPilot, 101 * kSecond).param1, 105);
}

TEST(MavlinkImuRequest, TakesTheOtherMessageWhenRefused) {
  ImuRequest request(200);
  request.question(kPilot, 5 * kSecond);
  request.receive({.command = 511, .result = 3}, kUs, 5 * kSecond);
  EXPECT_EQ(request.state(), RequestState::kRefused);
  const CommandLong command = request.question(kPilot, request.due_ns());
  EXPECT_EQ(command.param1, 27);
  EXPECT_EQ(command.confirmation, 0);
}

// One that says yes and sends nothing, or says nothing at all.
TEST(MavlinkImuRequest, TakesTheOtherMessageWhenNothingComes) {
  for (const bool accepts : {true, false}) {
    ImuRequest request(200);
    bool asked_other = false;
    for (int i = 0; i < 6; ++i) {
      const std::int64_t now_ns = 5 * kSecond + request.due_ns();
      asked_other = asked_other || request.question(kPilot, now_ns).param1 == 27;
      if (accepts) request.receive({.command = 511, .result = 0}, kUs, now_ns);
    }
    EXPECT_TRUE(asked_other) << accepts;
  }
}

TEST(MavlinkImuRequest, IgnoresAnswersToOthers) {
  ImuRequest request(200);
  request.receive({.command = 511, .result = 0}, kUs, kSecond);  // not asked yet
  EXPECT_EQ(request.state(), RequestState::kNone);
  request.question(kPilot, kSecond);
  request.receive({.command = 400, .result = 0}, kUs, kSecond);
  request.receive({.command = 511, .result = 2, .target_system = 1, .target_component = 191}, kUs, kSecond);
  request.receive({.command = 511, .result = 5}, kUs, kSecond);  // in progress
  EXPECT_EQ(request.state(), RequestState::kAsked);
  request.receive({.command = 511, .result = 0}, kUs, kSecond);
  request.receive({.command = 511, .result = 2}, kUs, kSecond);  // replayed
  EXPECT_EQ(request.state(), RequestState::kAccepted);
}

}  // namespace
}  // namespace epiline::mavlink
