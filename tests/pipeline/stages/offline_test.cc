// The stages in one thread, as a replay calls them.
#include "pipeline/stages/offline.h"

#include "tests/pipeline/stages/stage_support.h"

namespace epiline {
namespace {

using namespace test;

class OfflineTest : public testing::Test {
 protected:
  OfflineTest() {
    OfflineSettings settings;
    settings.camera = {CameraModel::kPinholeRadialTangential, 752, 480, {458, 457, 367, 248}, {}};
    settings.images = false;
    settings.clocks = {made_up_now, made_up_cpu};
    for (std::uint32_t k = 0; k < kImages; ++k)
      for (std::uint32_t id = 0; id < kPoints; ++id)
        points_.push_back({id, 60 + 60 * static_cast<float>(id % 10), 50 + 60 * static_cast<float>(id / 10)});
    for (std::size_t k = 0; k < kImages; ++k) settings.recorded.emplace_back(points_.data() + k * kPoints, kPoints);
    pipeline_ = std::make_unique<OfflinePipeline>(settings);
  }
  void feed(std::int64_t from_ms, std::int64_t until_ms) {
    for (; from_ms <= until_ms; from_ms += 5) {
      ImuSample sample = reading_at(from_ms);
      EXPECT_TRUE(pipeline_->add_imu(sample));
    }
  }
  FrameOutcome step(std::int64_t ms) {
    Frame image;
    image.stamp = image.arrival = at_ms(ms);
    image.sequence = sequence_++;
    EXPECT_TRUE(pipeline_->admit(image));
    FrameOutcome outcome;
    pipeline_->step(image, outcome);
    return outcome;
  }

  static constexpr std::uint32_t kImages = 6, kPoints = 60;
  std::vector<TrackPoint> points_;
  std::uint64_t sequence_ = 0;
  std::unique_ptr<OfflinePipeline> pipeline_;
};

TEST_F(OfflineTest, EachStepIsOneImageFromItsTracksToItsEstimate) {
  for (std::uint64_t k = 0; k < kImages; ++k) {
    const auto ms = static_cast<std::int64_t>(50 * k);
    feed(ms == 0 ? 0 : ms - 40, ms + 5);
    const FrameOutcome outcome = step(ms);
    EXPECT_EQ(outcome.serial, k);
    EXPECT_EQ(outcome.stamp, at_ms(ms));
    EXPECT_EQ(outcome.tracks, static_cast<int>(kPoints));
    EXPECT_EQ(outcome.new_tracks, k == 0 ? static_cast<int>(kPoints) : 0);
  }
}

// A recording whose IMU ends before its camera, or begins after it.
TEST_F(OfflineTest, NoImageWaitsForReadingsThatTheCallerDoesNotHave) {
  EXPECT_EQ(step(0).stamp, at_ms(0));
  feed(5, 60);
  EXPECT_EQ(step(50).stamp, at_ms(50));
  for (const std::int64_t ms : {100, 150, 400}) {
    const FrameOutcome outcome = step(ms);
    EXPECT_EQ(outcome.stamp, at_ms(ms));
    EXPECT_FALSE(outcome.result.has_pose);
  }
  for (Event event; pipeline_->events().pop(event);)
    EXPECT_NE(event.id, EventId::kImuLate) << "there is nothing to wait for";
}

}  // namespace
}  // namespace epiline
