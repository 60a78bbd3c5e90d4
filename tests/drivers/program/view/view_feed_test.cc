#include "drivers/program/view/view_feed.h"

#include <gtest/gtest.h>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "platform/time/monotonic.h"
#include "tests/drivers/program/view/flight_of_view.h"

namespace epiline {
namespace {

TEST(ViewFeed, HandsOverAnImageWithItsOwnTracks) {
  ViewFeed feed;
  ViewedFlight flight(feed);
  flight.fly();
  flight.fly();
  const ViewedImage* const image = feed.newest_image();
  ASSERT_NE(image, nullptr);
  EXPECT_EQ(image->sequence, 0u);
  EXPECT_EQ(image->width, ViewedFlight::kWidth);
  EXPECT_EQ(image->camera_height, ViewedFlight::kHeight);
  EXPECT_EQ(image->tracks.size(), 40u);
  EXPECT_EQ(image->tracks[1].u, 27.0F);
  EXPECT_EQ(image->pixels[ViewedFlight::kWidth * ViewedFlight::kHeight - 1], ViewedFlight::kGrey);
  EXPECT_EQ(feed.newest_image(), nullptr);  // nothing new
}

TEST(ViewFeed, CopiesAreFewWhileNobodyLooks) {
  ViewFeed feed;
  ViewedFlight flight(feed);
  flight.fly();
  ASSERT_NE(feed.newest_image(), nullptr);
  flight.fly(100);  // takes far less than the second until the next copy
  EXPECT_EQ(feed.newest_image(), nullptr);
}

TEST(ViewFeed, AReaderThatStopsLosesThingsAndNobodyElseDoes) {
  ViewFeed feed;
  ViewedFlight flight(feed);
  feed.note_viewer(monotonic_ns());
  flight.fly(1000);
  EXPECT_GT(feed.left_out(), 0u);
  std::uint64_t outcomes = 0, last = 0;
  for (ViewedOutcome o; feed.next(o); ++outcomes) last = o.outcome.serial;
  EXPECT_EQ(outcomes, 128u);
  EXPECT_EQ(last, 127u);
  flight.fly();  // and goes on
  ViewedOutcome o;
  ASSERT_TRUE(feed.next(o));
  EXPECT_EQ(o.outcome.serial, 1000u);
  EXPECT_EQ(o.imu_samples, 10'010u);
}

TEST(ViewFeed, LargeImagesAreThinned) {
  ViewFeed feed;
  const int w = 2001, h = 1503, stride = 2016;
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(stride) * h);
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) pixels[static_cast<std::size_t>(y) * stride + x] = static_cast<std::uint8_t>(x + 3 * y);
  }
  LoggedTracks tracks;
  tracks.sequence = 5;
  feed.image({HostStamp{1}, 5, pixels.data(), w, h, stride, 0}, {});
  feed.tracks(tracks);
  const ViewedImage* const image = feed.newest_image();
  ASSERT_NE(image, nullptr);
  EXPECT_EQ(image->camera_width, w);
  EXPECT_EQ(image->width, 1000);
  EXPECT_EQ(image->height, 751);
  for (const auto& [x, y] : {std::pair(0, 0), std::pair(999, 750), std::pair(17, 400)}) {
    EXPECT_EQ(image->pixels[static_cast<std::size_t>(y) * 1000 + x], static_cast<std::uint8_t>(2 * x + 6 * y));
  }
}

TEST(ViewFeed, ASecondCamerasImageIsAtTheRightOfTheFirstOnes) {
  ViewFeed feed;
  const std::vector<std::uint8_t> one(40 * 30, 11), two(20 * 25, 22);  // a smaller image
  LoggedTracks tracks;
  tracks.points.push_back({1, 2, 3, 4});
  tracks.others[0].push_back({1, 2, 5, 6});
  const auto shown = [&](std::uint64_t sequence, const Frame& second) {
    feed.note_viewer(monotonic_ns());
    const ViewedImage* image = nullptr;
    for (tracks.sequence = sequence; image == nullptr; ++tracks.sequence) {  // 22 a second at most
      feed.image({HostStamp{1}, tracks.sequence, one.data(), 40, 30, 40, 0}, {second});
      feed.tracks(tracks);
      image = feed.newest_image();
    }
    return image;
  };
  const ViewedImage* image = shown(1, {HostStamp{1}, 1, two.data(), 20, 25, 20, 0});
  EXPECT_EQ(image->width, 60);
  EXPECT_EQ(image->camera_width, 60);
  EXPECT_EQ(image->height, 30);
  EXPECT_EQ(image->others_x[0], 40);
  const auto pixel = [&](int x, int y) { return image->pixels[static_cast<std::size_t>(60 * y + x)]; };
  EXPECT_EQ(pixel(39, 29), 11);
  EXPECT_EQ(pixel(40, 0), 22);
  EXPECT_EQ(pixel(59, 24), 22);
  EXPECT_EQ(pixel(59, 25), 0) << "below the smaller image";
  ASSERT_EQ(image->other_tracks[0].size(), 1u);
  EXPECT_EQ(image->other_tracks[0][0].u, 5);

  image = shown(tracks.sequence, {});
  EXPECT_EQ(image->width, 60) << "its place stays when an image is missing";
  EXPECT_EQ(pixel(39, 0), 11);
  EXPECT_EQ(pixel(40, 0), 0);
}

TEST(ViewFeed, TracksAloneAreShownWhereNoImagesCome) {
  ViewFeed feed;
  feed.expect_images(false);
  LoggedTracks tracks;
  tracks.points.push_back({1, 2, 3, 4});
  feed.tracks(tracks);
  const ViewedImage* const image = feed.newest_image();
  ASSERT_NE(image, nullptr);
  EXPECT_EQ(image->width, 0);
  EXPECT_EQ(image->tracks.size(), 1u);
}

// An image whose tracks, or tracks whose image never came must not be shown, nor keep the next from it.
TEST(ViewFeed, HalvesAreLeftOut) {
  ViewFeed feed;
  std::vector<std::uint8_t> pixels(100);
  LoggedTracks tracks;
  const auto image = [&](std::uint64_t sequence) {
    feed.image({HostStamp{}, sequence, pixels.data(), 10, 10, 10, 0}, {});
  };
  image(1);
  image(2);
  tracks.sequence = 3;
  feed.tracks(tracks);
  tracks.sequence = 4;
  feed.tracks(tracks);
  image(3);  // too late
  EXPECT_EQ(feed.newest_image(), nullptr);
  image(4);
  const ViewedImage* const shown = feed.newest_image();
  ASSERT_NE(shown, nullptr);
  EXPECT_EQ(shown->sequence, 4u);
}

TEST(ViewFeed, GapsInTheCamerasNumbersAreLostImages) {
  ViewFeed feed;
  LoggedTracks tracks;
  FrameOutcome outcome;
  for (const std::uint64_t sequence : {7, 8, 11, 12, 20}) {
    tracks.sequence = sequence;
    feed.tracks(tracks);
  }
  feed.take(outcome);
  ViewedOutcome told;
  ASSERT_TRUE(feed.next(told));
  EXPECT_EQ(told.images_lost, 9u);
}

TEST(ViewFeed, UsesNoHeapAndNoLock) {
  ViewFeed feed;
  ViewedFlight flight(feed);
  flight.fly();
  feed.note_viewer(monotonic_ns());
  const HeapCallScope heap;
  const std::uint64_t locks = lock_calls_of_this_thread();
  for (int i = 0; i < 300; ++i) {
    flight.fly();
    feed.event({HostStamp{}, EventId::kReset, {}});
  }
  const std::uint64_t heap_calls = heap.calls(), lock_calls = lock_calls_of_this_thread() - locks;
  EXPECT_EQ(heap_calls, 0u);
  EXPECT_EQ(lock_calls, 0u);
}

}  // namespace
}  // namespace epiline
