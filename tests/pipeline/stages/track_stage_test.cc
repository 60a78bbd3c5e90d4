#include "pipeline/stages/track_stage.h"

#include "pipeline/stages/capture_stage.h"
#include "tests/pipeline/stages/stage_support.h"

namespace epiline {
namespace {

using namespace test;

constexpr TrackPoint kPoints[] = {{1, 40, 50}, {2, 80, 60}, {3, 120, 90}};

class TrackStageTest : public StageTest {
 protected:
  explicit TrackStageTest(bool of_images = true, bool two_cameras = false) {
    settings.camera = {
        CameraModel::kPinholeRadialTangential, MadeUpCamera::kWidth, MadeUpCamera::kHeight, {100, 100, 80, 60}, {}};
    settings.images = of_images;
    if (two_cameras) settings.others[0] = {settings.camera, {Mat3::Identity(), Vec3(0.1, 0, 0)}};
    settings.recorded = recorded;
    settings.imu_patience = Span::from_milliseconds(20);
    stage = std::make_unique<TrackStage>(settings, Knowledge{}, clock,
                                         TrackStage::Inputs{frames, images, camera_ended, *imu, imu_ended, knowledge},
                                         TrackStage::Outputs{*tracked, parking, *events, &no_log});
  }
  void show(std::int64_t ms, bool dark = false, const Frame& second = {}) {
    const Frame image = camera.image(ms, dark);
    images.lend(image, {second});
    const auto evicted = frames.push(static_cast<FrameRing::Value>(image.slot));
    if (evicted != FrameRing::kNone) images.give_back(evicted);
  }
  void feed(std::int64_t from_ms, std::int64_t to_ms) {
    for (; from_ms <= to_ms; from_ms += 5) imu->push(reading_at(from_ms));
  }
  /// What the estimator does: takes a tracked frame and teaches its lesson.
  TrackedFrame estimate() {
    Tracked taken;
    EXPECT_TRUE(tracked->pop(taken));
    knowledge.push({});
    return taken.frame;
  }
  bool tracks() { return tracked->front() != nullptr; }
  std::array<std::span<const TrackPoint>, 16> points;
  std::span<const std::span<const TrackPoint>> recorded{(points.fill(kPoints), points)};
  TrackStageSettings settings;
  MadeUpCamera camera;
  LentImages images{&camera};
  FrameRing frames;
  EndMark camera_ended, imu_ended;
  std::unique_ptr<ImuRing> imu = std::make_unique<ImuRing>();
  KnowledgeRing knowledge;
  std::unique_ptr<TrackedRing> tracked = std::make_unique<TrackedRing>();
  Parking parking;
  LoggedImages no_log{0};
  std::unique_ptr<TrackStage> stage;
};

class RecordedTrackStage : public TrackStageTest {
 protected:
  RecordedTrackStage() : TrackStageTest(false) {}
};

class TwoCamerasTrackStage : public TrackStageTest {
 protected:
  TwoCamerasTrackStage() : TrackStageTest(true, true) {}
  MadeUpCamera second_camera;
};

TEST_F(TrackStageTest, AnImageIsTrackedWhenItsReadingsHaveCome) {
  EXPECT_EQ(sleeps_until_ms(*stage), 100);
  show(50);
  EXPECT_TRUE(stage->ready());
  EXPECT_EQ(sleeps_until_ms(*stage), 20);
  feed(0, 45);
  EXPECT_TRUE(stage->ready());
  to_ms(3);
  EXPECT_EQ(sleeps_until_ms(*stage), 23) << "the wait is for the next reading";
  EXPECT_FALSE(tracks());
  feed(50, 55);
  run(*stage);
  const TrackedFrame frame = estimate();
  EXPECT_EQ(frame.stamp, at_ms(50));
  EXPECT_GT(frame.features.size(), 5u);
  EXPECT_EQ(stage->imu_late(), 0u);
  EXPECT_EQ(imu->popped(), 11u) << "one at the image's time, none after";
}

TEST_F(TrackStageTest, ASilentImuIsWaitedForOnceAndItsEndNotAtAll) {
  show(0);
  EXPECT_EQ(sleeps_until_ms(*stage), 20);
  to_ms(20);
  run(*stage);
  EXPECT_TRUE(tracks());
  EXPECT_EQ(stage->imu_late(), 1u);
  EXPECT_EQ(told(), Lines{"0 imu_late waited_ms=20"});
  show(50);
  run(*stage);
  EXPECT_EQ(tracked->published(), 2u) << "not waited for again";
  EXPECT_EQ(stage->imu_late(), 2u);
  estimate();
  feed(0, 100);
  show(100);
  run(*stage);
  estimate();
  estimate();
  EXPECT_EQ(stage->imu_late(), 2u);
  show(150);
  EXPECT_EQ(sleeps_until_ms(*stage), 40) << "it has spoken: waited for again";
  imu_ended.set();
  run(*stage);
  EXPECT_EQ(tracked->published(), 4u);
  EXPECT_EQ(stage->imu_late(), 2u) << "nothing to wait for";
}

TEST_F(TrackStageTest, TheThirdImageWaitsForTheFirstLesson) {
  imu_ended.set();
  for (const int ms : {0, 50, 100}) show(ms);
  run(*stage);
  EXPECT_EQ(tracked->published(), 2u);
  EXPECT_EQ(camera.returned, 1);
  show(150);
  EXPECT_EQ(sleeps_until_ms(*stage), 100);
  knowledge.push({{}, 0, Span::from_milliseconds(7)});
  EXPECT_TRUE(stage->ready());
  run(*stage);
  EXPECT_EQ(tracked->published(), 3u);
  EXPECT_EQ(stage->imu_needed_until(at_ms(0)), at_ms(7));
}

TEST_F(TrackStageTest, AfterAnOverflowTheNewestIsNextAndTheOthersGoBack) {
  imu_ended.set();
  for (int i = 0; i < 6; ++i) show(50 * i);
  run(*stage);
  EXPECT_EQ(tracked->published(), 1u);
  EXPECT_EQ(tracked->front()->frame.stamp, at_ms(250));
  EXPECT_EQ(camera.away(), 1) << "the one that the tracker keeps";
  EXPECT_EQ(told(), (Lines{"100 image_dropped sequence=2 reason=overtaken images=1",
                           "150 image_dropped sequence=3 reason=overtaken images=1",
                           "200 image_dropped sequence=4 reason=overtaken images=1"}));
}

TEST_F(TrackStageTest, ADarkImageGoesBackAtOnceAndTheOneBeforeIsKept) {
  imu_ended.set();
  show(0);
  show(50, true);
  run(*stage);
  EXPECT_EQ(images.users(0), 1u);
  EXPECT_EQ(images.users(1), 0u) << "the dark one";
  EXPECT_EQ(camera.away(), 1);
  EXPECT_GT(estimate().features.size(), 0u);
  EXPECT_EQ(estimate().features.size(), 0u);
  show(100);
  run(*stage);
  const TrackedFrame frame = estimate();
  ASSERT_GT(frame.features.size(), 0u);
  EXPECT_EQ(frame.features[0].age, 1u) << "tracked from the image before the dark one";
  EXPECT_EQ(camera.away(), 1);
}

// Each tracker goes on from the last image that it was shown.
TEST_F(TwoCamerasTrackStage, BesideADarkImageTheSecondOneIsKept) {
  imu_ended.set();
  const auto show_both = [&](std::int64_t ms, bool dark, bool second_dark) {
    show(ms, dark, second_camera.image(ms, second_dark));
    run(*stage);
    return estimate();
  };
  EXPECT_GT(show_both(0, false, false).others[0].alone.size(), 0u);
  EXPECT_EQ(images.users(0), 2u) << "both images are kept";
  TrackedFrame frame = show_both(50, true, false);
  EXPECT_EQ(frame.features.size(), 0u);
  ASSERT_GT(frame.others[0].alone.size(), 0u);
  EXPECT_EQ(frame.others[0].alone[0].age, 1u);
  EXPECT_EQ(images.users(0), 1u);
  EXPECT_EQ(images.users(1), 1u);
  frame = show_both(100, true, false);
  EXPECT_EQ(frame.others[0].alone[0].age, 2u);
  EXPECT_EQ(images.users(1), 0u) << "followed by a newer one";
  EXPECT_EQ(camera.away(), 2);
  frame = show_both(150, false, false);
  EXPECT_EQ(frame.features[0].age, 1u) << "tracked from the image before the dark ones";
  EXPECT_EQ(frame.others[0].alone[0].age, 3u);
  EXPECT_EQ(camera.away(), 1);
  frame = show_both(200, false, true);
  EXPECT_EQ(frame.others[0].alone.size(), 0u);
  EXPECT_EQ(frame.others[0].views.size(), 0u);
  EXPECT_EQ(frame.features[0].age, 2u);
  EXPECT_EQ(camera.away(), 1) << "the covered one's tracker has no use for what it was shown before";
  stage->give_back_all();
  EXPECT_EQ(camera.away(), 0);
}

TEST_F(TrackStageTest, StoppedInTheMiddleItGivesEverythingBack) {
  show(0);
  feed(0, 0);
  run(*stage);
  for (const int ms : {50, 100, 150, 200, 250, 300}) {
    show(ms);
    stage->step();  // the first of them is taken, and waits for readings
  }
  EXPECT_EQ(camera.away(), 6) << "one kept, one in hand, four waiting";
  stage->give_back_all();
  EXPECT_EQ(camera.away(), 0);
  EXPECT_FALSE(frames.ready());
  stage->give_back_all();  // once is enough
}

TEST_F(TrackStageTest, WhatTheLogHasNoRoomForComesBack) {
  imu_ended.set();
  LoggedImages two(2);
  stage = std::make_unique<TrackStage>(settings, Knowledge{}, clock,
                                       TrackStage::Inputs{frames, images, camera_ended, *imu, imu_ended, knowledge},
                                       TrackStage::Outputs{*tracked, parking, *events, &two});
  for (int i = 0; i < 5; ++i) {
    show(50 * i);
    run(*stage);
    estimate();
  }
  EXPECT_EQ(two.skipped(), 3u);
  EXPECT_EQ(camera.away(), 3) << "two with the log, one with the tracker";
  stage->give_back_all();
  for (Frame image; two.ring().pop(image);) images.give_back(static_cast<std::size_t>(image.slot));
  EXPECT_EQ(camera.away(), 0);
}

TEST_F(TrackStageTest, WithoutImagesItTakesReadingsBeforeTheirRingIsFull) {
  for (int i = 0; i < 20; ++i) {
    for (int k = 0; k < 1000; ++k) imu->push(reading_at(5 * (1000 * i + k)));
    EXPECT_EQ(sleeps_until_ms(*stage), 100);
  }
  EXPECT_EQ(imu->dropped(), 0u);
  EXPECT_EQ(imu->published() - imu->popped(), kImuRing / 2);
}

TEST_F(TrackStageTest, EndsWhenTheLastImageIsDone) {
  imu_ended.set();
  show(0);
  show(50);
  camera_ended.set();
  EXPECT_EQ(stage->step().did, Step::Did::kWork);
  stage->step();
  stage->step();
  stage->step();
  EXPECT_EQ(tracked->published(), 2u);
  EXPECT_EQ(run(*stage).did, Step::Did::kNothing) << "a lesson is still due";
  estimate();
  EXPECT_EQ(run(*stage).did, Step::Did::kEnd);
  stage->give_back_all();
  EXPECT_EQ(camera.away(), 0);
}

TEST_F(RecordedTrackStage, PointsTakeTheImagesPlaceAndNoReadingIsWaitedFor) {
  show(0);
  show(50);
  run(*stage);
  EXPECT_EQ(estimate().features.size(), 3u);
  const TrackedFrame frame = estimate();
  ASSERT_EQ(frame.features.size(), 3u);
  EXPECT_EQ(frame.features[0].age, 1u);
  EXPECT_FALSE(stage->wants_imu());
  EXPECT_EQ(stage->tracker_stats(), nullptr);
  stage->give_back_all();
  EXPECT_EQ(camera.away(), 0);
}

}  // namespace
}  // namespace epiline
