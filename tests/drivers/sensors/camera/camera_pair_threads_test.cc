#include "drivers/sensors/camera/camera_pair.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>

#include "platform/time/monotonic.h"

namespace epiline {
namespace {

/// What a test gives, in its order; waits if there is nothing.
class GivenCamera final : public CameraSource {
 public:
  explicit GivenCamera(Status opens = Done{}) : opens_(std::move(opens)) {}

  Status open() override { return opens_; }
  void close() noexcept override { is_closed = true; }
  ReadOutcome read(Frame& frame, Span timeout) noexcept override {
    const std::int64_t until_ns = monotonic_ns() + timeout.ns;
    do {
      const std::lock_guard lock(mutex_);
      if (fails) return ReadOutcome::kFailed;
      if (given_.empty()) continue;
      frame = given_.front();
      given_.pop_front();
      ++lent;
      return ReadOutcome::kSample;
    } while (monotonic_ns() < until_ns);
    return ReadOutcome::kTimeout;
  }
  void give_back(const Frame& /*frame*/) noexcept override { --lent; }

  void give(std::int64_t stamp_ms, std::uint8_t brightness) {
    const std::lock_guard lock(mutex_);
    Frame frame;
    frame.stamp = HostStamp{stamp_ms * 1'000'000};
    pixels_[static_cast<std::size_t>(next_)] = brightness;
    frame.data = &pixels_[static_cast<std::size_t>(next_)];
    frame.width = frame.height = frame.stride = 1;
    frame.slot = next_;
    next_ = (next_ + 1) % static_cast<int>(pixels_.size());
    given_.push_back(frame);
  }

  std::atomic<int> lent{0};
  std::atomic<bool> fails{false}, is_closed{false};

 private:
  Status opens_;
  std::mutex mutex_;
  std::deque<Frame> given_;
  std::array<std::uint8_t, 64> pixels_{};
  int next_ = 0;
};

constexpr Span kLong = Span::from_milliseconds(60'000);  ///< that a busy computer may take

class Pair : public testing::Test {
 protected:
  void open(const PairSettings& settings = {.patience = kLong}) {
    auto first = std::make_unique<GivenCamera>(), second = std::make_unique<GivenCamera>();
    first_ = first.get();
    second_ = second.get();
    pair_ = std::make_unique<CameraPair>(std::move(first), std::move(second), settings);
    const Status status = pair_->open();
    ASSERT_TRUE(status) << status.error().text();
  }
  /// The brightness of the next image's partner; -1: it has none. -2: no image.
  int partner() {
    Frame frame;
    if (pair_->read(frame, kLong) != ReadOutcome::kSample) return -2;
    const Frame second = pair_->others(frame)[0];
    const int found = second.data == nullptr ? -1 : *second.data;
    pair_->give_back(frame);
    return found;
  }
  /// What came last.
  ReadOutcome read_for_half_a_second() {
    const std::int64_t until_ns = monotonic_ns() + 500'000'000;
    Frame frame;
    ReadOutcome outcome;
    do outcome = pair_->read(frame, Span::from_milliseconds(100));
    while (outcome != ReadOutcome::kSample && monotonic_ns() < until_ns);
    return outcome;
  }
  /// Waits until the second camera's thread has taken all that was given.
  void until_unused(std::uint64_t count) const {
    while (pair_->counts().unused < count) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

  GivenCamera *first_ = nullptr, *second_ = nullptr;
  std::unique_ptr<CameraPair> pair_;
};

TEST_F(Pair, ImagesOfOneTimeComeTogether) {
  open();
  for (int i = 1; i < 100; ++i) {
    second_->give(50 * i, static_cast<std::uint8_t>(i));
    first_->give(50 * i + i % 2, 0);  // a millisecond apart
    ASSERT_EQ(partner(), i);
  }
  EXPECT_EQ(pair_->counts().pairs, 99u);
  EXPECT_EQ(first_->lent, 0);
  EXPECT_EQ(second_->lent, 0);
}

/// Free-running cameras, the second one a little faster: its images wander through the first one's periods of 50 ms.
TEST_F(Pair, TheNearestOfAFreeRunningCameraComesWithItsTime) {
  open({.within = Span::from_milliseconds(25), .patience = kLong});
  int given = 0;
  for (int i = 1; i < 50; ++i) {
    for (; 49 * given <= 50 * i + 25; ++given) second_->give(49 * given, static_cast<std::uint8_t>(given));
    first_->give(50 * i, 0);
    Frame frame;
    ASSERT_EQ(pair_->read(frame, kLong), ReadOutcome::kSample);
    const Frame second = pair_->others(frame)[0];
    ASSERT_NE(second.data, nullptr) << i;
    EXPECT_EQ(second.stamp.ns, std::int64_t{49'000'000} * *second.data);
    EXPECT_LE(std::abs((second.stamp - frame.stamp).ns), 25'000'000) << i;
    pair_->give_back(frame);
  }
  EXPECT_EQ(pair_->counts().pairs, 49u);
}

TEST_F(Pair, AnImageWithoutPartnerComesAlone) {
  open();
  second_->give(52, 1);  // two milliseconds later than the first's
  first_->give(50, 0);
  EXPECT_EQ(partner(), -1);
  first_->give(52, 0);  // and there is the one that it belongs to
  EXPECT_EQ(partner(), 1);
  second_->give(98, 2);
  second_->give(100, 3);
  first_->give(100, 0);
  EXPECT_EQ(partner(), 3);
  const PairCounts counts = pair_->counts();
  EXPECT_EQ(counts.pairs, 2u);
  EXPECT_EQ(counts.without, 1u);
  EXPECT_EQ(counts.unused, 1u);
  EXPECT_EQ(second_->lent, 0);
}

TEST_F(Pair, TheSecondCamerasClockIsPutRight) {
  open({.second_later = Span::from_milliseconds(7), .patience = kLong});
  second_->give(43, 9);
  first_->give(50, 0);
  EXPECT_EQ(partner(), 9);
}

TEST_F(Pair, ALostSecondCameraStopsNothingAndMayComeBack) {
  open({});
  second_->fails = true;
  for (int i = 1; i <= 20; ++i) {
    first_->give(50 * i, 0);
    ASSERT_EQ(partner(), -1);
  }
  second_->fails = false;
  second_->give(2'000, 5);
  int found = -1;  // nobody waits for it any more, so that it is missed at first, perhaps
  for (int i = 0; i < 60'000 && found == -1; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    first_->give(2'000, 0);
    found = partner();
  }
  EXPECT_EQ(found, 5);
}

TEST_F(Pair, ASilentFirstCameraLeavesTheSecondOneItsBuffers) {
  open();
  for (int i = 1; i <= 30; ++i) second_->give(50 * i, 1);
  until_unused(26);  // four wait
  EXPECT_EQ(second_->lent, 4);
  first_->give(200, 0);  // the last of those that wait
  EXPECT_EQ(partner(), 1);
  EXPECT_EQ(second_->lent, 0);
}

TEST_F(Pair, WhileTheFirstOneIsSilentTheSecondOneGoesOnAlone) {
  for (const bool is_lost : {false, true}) {
    open({.patience = kLong, .width = 3, .height = 2});
    const auto next = [&] {
      Frame frame;
      while (pair_->read(frame, Span::from_milliseconds(1000)) != ReadOutcome::kSample)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return frame;
    };
    second_->give(10, 1);
    second_->give(20, 2);
    EXPECT_NE(read_for_half_a_second(), ReadOutcome::kSample) << "the first one has not begun";
    for (int i = 1; i <= 3; ++i) {
      second_->give(50 * i, 7);
      first_->give(50 * i, 0);
      pair_->give_back(next());
    }
    first_->fails = is_lost;
    for (int i = 4; i <= 6; ++i) second_->give(50 * i, static_cast<std::uint8_t>(i));
    for (int i = 4; i <= 6; ++i) {
      const Frame alone = next();
      EXPECT_EQ(alone.stamp.ns, 50'000'000 * i);
      EXPECT_EQ(alone.width, 3);
      EXPECT_EQ(alone.height, 2);
      EXPECT_EQ(std::count(alone.data, alone.data + 6, 0), 6) << "black";
      EXPECT_EQ(*pair_->others(alone)[0].data, i);
      EXPECT_EQ(first_->lent, 0);
      pair_->give_back(alone);
    }
    EXPECT_EQ(second_->lent, 0);
    first_->fails = false;
    first_->give(300, 0);  // comes after that of the second one has gone on
    second_->give(350, 8);
    first_->give(350, 5);
    const Frame back = next();
    EXPECT_EQ(back.stamp.ns, 350'000'000);
    EXPECT_EQ(*back.data, 5);
    EXPECT_EQ(*pair_->others(back)[0].data, 8);
    pair_->give_back(back);
    EXPECT_EQ(pair_->counts().alone, 3u);
    EXPECT_EQ(pair_->counts().pairs, 4u);
    EXPECT_EQ(first_->lent, 0);
    EXPECT_EQ(second_->lent, 0);
  }
}

TEST_F(Pair, WithNeitherOfTheTwoThereAreNoImages) {
  open({.patience = kLong, .width = 1, .height = 1});
  for (int i = 1; i <= 2; ++i) {
    second_->give(50 * i, 7);
    first_->give(50 * i, 0);
    EXPECT_EQ(partner(), 7);
  }
  first_->fails = second_->fails = true;
  EXPECT_EQ(read_for_half_a_second(), ReadOutcome::kFailed);
}

/// The first one of a pair may itself be a pair.
TEST(PairOfPairs, TheThirdCamerasImageComesWithBothOthers) {
  std::array<GivenCamera*, 3> cameras{};
  const auto given = [&](std::size_t i) {
    auto camera = std::make_unique<GivenCamera>();
    cameras[i] = camera.get();
    return camera;
  };
  PairSettings settings{.patience = kLong, .width = 1, .height = 1};
  auto two = std::make_unique<CameraPair>(given(0), given(1), settings);
  settings.number = 2;
  CameraPair three(std::move(two), given(2), settings);
  ASSERT_TRUE(three.open());
  const auto next = [&] {
    Frame frame;
    while (three.read(frame, Span::from_milliseconds(1000)) != ReadOutcome::kSample) {
    }
    return frame;
  };
  const auto show = [&](int i, const std::array<bool, 3>& shows) {
    for (const std::size_t c : {2U, 1U, 0U})
      if (shows[c]) cameras[c]->give(50 * i, static_cast<std::uint8_t>(10 * i + static_cast<int>(c)));
  };
  for (int i = 1; i <= 3; ++i) {
    show(i, {true, true, true});
    const Frame frame = next();
    const OtherFrames others = three.others(frame);
    EXPECT_EQ(*frame.data, 10 * i);
    EXPECT_EQ(*others[0].data, 10 * i + 1);
    EXPECT_EQ(*others[1].data, 10 * i + 2);
    EXPECT_EQ(others[2].data, nullptr);
    three.give_back(frame);
  }
  show(4, {false, true, true});  // the second one goes on, and the third one with it
  const Frame without_first = next();
  EXPECT_EQ(*without_first.data, 0) << "black";
  EXPECT_EQ(*three.others(without_first)[0].data, 41);
  EXPECT_EQ(*three.others(without_first)[1].data, 42);
  show(5, {false, false, true});
  const Frame third_alone = next();
  EXPECT_EQ(*third_alone.data, 0);
  EXPECT_EQ(three.others(third_alone)[0].data, nullptr);
  EXPECT_EQ(*three.others(third_alone)[1].data, 52);
  EXPECT_GE(third_alone.slot, 2 * CameraPair::kMostSlots) << "below are those of the two before it";
  three.give_back(third_alone);
  three.give_back(without_first);
  for (const GivenCamera* camera : cameras) EXPECT_EQ(camera->lent, 0);
}

TEST(PairOpens, OnlyIfBothDo) {
  auto first = std::make_unique<GivenCamera>();
  const GivenCamera* const opened = first.get();
  CameraPair pair(std::move(first),
                  std::make_unique<GivenCamera>(Error{ErrorKind::kRun, "/dev/video7", 0, "is not there", ""}), {});
  const Status status = pair.open();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().file, "/dev/video7");
  EXPECT_TRUE(opened->is_closed);
}

}  // namespace
}  // namespace epiline
