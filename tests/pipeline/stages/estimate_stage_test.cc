#include "pipeline/stages/estimate_stage.h"

#include "tests/pipeline/stages/stage_support.h"

namespace epiline {
namespace {

using namespace test;

class EstimateStageTest : public StageTest {
 protected:
  EstimateStageTest() { make(EstimateStage::Log{*outcomes, *tracks, log}); }
  void make(std::optional<EstimateStage::Log> to_log, double deadline_ms = 0) {
    stage = std::make_unique<EstimateStage>(
        EstimateStageSettings{{}, 0, deadline_ms, Span::from_milliseconds(20)}, clock,
        EstimateStage::Inputs{*tracked, tracker_ended, *imu, imu_ended, speeds, heights},
        EstimateStage::Outputs{knowledge, tracker, *events, &newest, &publisher, to_log});
  }
  void show(std::int64_t ms) {
    Tracked* const image = tracked->claim();
    ASSERT_NE(image, nullptr);
    *image = {};
    image->frame.stamp = at_ms(ms);
    image->frame.sequence = sequence++;
    image->frame.features.push_back({.id = 3, .age = 1, .pixel = {1.5F, 2.5F}, .bearing = {0, 0, 1}});
    image->frame.features.push_back({.id = 7, .age = 4, .pixel = {-3.25F, 8}, .bearing = {0, 0.6, 0.8}});
    image->track = {1234, 0};
    tracked->publish();
  }
  void feed(std::int64_t from_ms, std::int64_t to_ms) {
    for (; from_ms <= to_ms; from_ms += 5) imu->push(reading_at(from_ms));
  }
  /// The tracker takes its lesson.
  bool lesson() {
    Knowledge taken;
    return knowledge.pop(taken);
  }

  std::unique_ptr<TrackedRing> tracked = std::make_unique<TrackedRing>();
  EndMark tracker_ended, imu_ended;
  std::unique_ptr<ImuRing> imu = std::make_unique<ImuRing>();
  WheelRing speeds;
  HeightRing heights;
  KnowledgeRing knowledge;
  Parking tracker, publisher, log;
  LatestValue<Estimate> newest;
  std::unique_ptr<OutcomeRing> outcomes = std::make_unique<OutcomeRing>();
  std::unique_ptr<TracksLogRing> tracks = std::make_unique<TracksLogRing>();
  std::uint64_t sequence = 40;
  std::unique_ptr<EstimateStage> stage;
};

TEST_F(EstimateStageTest, AnImageBringsAnEstimateALessonAndARecord) {
  show(50);
  EXPECT_EQ(sleeps_until_ms(*stage), 20);
  feed(0, 60);
  run(*stage);
  ASSERT_NE(newest.read(), nullptr);
  EXPECT_EQ(newest.read()->serial, 1u);
  EXPECT_FALSE(newest.read()->has_pose) << "one image is no start";
  EXPECT_EQ(newest.read()->solved_serial, 0u);
  EXPECT_TRUE(lesson());
  EXPECT_FALSE(lesson());
  ASSERT_NE(outcomes->front(), nullptr);
  EXPECT_EQ(outcomes->front()->serial, 0u);
  EXPECT_EQ(outcomes->front()->tracks, 2);
  EXPECT_EQ(outcomes->front()->track.wall_ns, 1234);
  const LoggedTracks* const logged = tracks->front();
  ASSERT_NE(logged, nullptr);
  EXPECT_EQ(logged->serial, 0u);
  EXPECT_EQ(logged->sequence, 40u);
  EXPECT_EQ(logged->stamp, at_ms(50));
  ASSERT_EQ(logged->points.size(), 2u);
  EXPECT_EQ(logged->points[1].id, 7u);
  EXPECT_EQ(logged->points[1].age, 4u);
  EXPECT_EQ(logged->points[1].u, -3.25F);
  EXPECT_EQ(stage->images(), 1u);
}

TEST_F(EstimateStageTest, ASilentImuIsWaitedForOnceAndItsEndNotAtAll) {
  show(0);
  EXPECT_EQ(sleeps_until_ms(*stage), 20);
  EXPECT_EQ(stage->images(), 0u);
  to_ms(20);
  EXPECT_EQ(run(*stage).did, Step::Did::kNothing);
  EXPECT_EQ(stage->images(), 1u);
  EXPECT_EQ(told(), Lines{"0 imu_late waited_ms=20"});
  imu_ended.set();
  show(50);
  run(*stage);
  EXPECT_EQ(stage->images(), 2u);
  EXPECT_EQ(stage->imu_late(), 1u);
}

TEST_F(EstimateStageTest, AnImageAfterItsDeadlineIsTold) {
  make({}, 30);
  feed(0, 200);
  show(0);
  to_ms(30);
  run(*stage);
  EXPECT_EQ(told(), Lines{}) << "just in time";
  show(50);
  to_ms(95);
  run(*stage);
  EXPECT_EQ(told(), Lines{"50 deadline_missed sequence=41 late_ns=15000000"});
}

TEST_F(EstimateStageTest, AnImageThatWaitsStaysInItsRing) {
  show(0);
  run(*stage);
  EXPECT_EQ(tracked->popped(), 0u) << "a stop loses nothing that was begun";
}

TEST_F(EstimateStageTest, AFullLogLosesRecordsAndNothingElse) {
  feed(0, 1);
  imu_ended.set();
  for (int i = 0; i < 300; ++i) {
    show(50 * i);
    run(*stage);
    EXPECT_TRUE(lesson());
  }
  EXPECT_EQ(stage->images(), 300u);
  EXPECT_EQ(newest.read()->serial, 300u);
  EXPECT_EQ(outcomes->dropped(), 44u);
  EXPECT_EQ(tracks->dropped(), 236u);
  EXPECT_EQ(stage->outcome().serial, 299u);
}

TEST_F(EstimateStageTest, AStampThatGoesBackBringsNoPoseButItsLesson) {
  feed(0, 200);
  for (const int ms : {100, 50, 150}) show(ms);
  run(*stage);
  EXPECT_EQ(stage->images(), 3u);
  EXPECT_EQ(stage->back_end().estimator().stats().frames_refused, 1u);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(lesson()) << "the tracker would wait for it for ever";
}

TEST_F(EstimateStageTest, WithoutImagesItTakesReadingsBeforeTheirRingIsFull) {
  for (int i = 0; i < 10; ++i) {
    for (int k = 0; k < 1000; ++k) imu->push(reading_at(5 * (1000 * i + k)));
    EXPECT_EQ(sleeps_until_ms(*stage), 100);
  }
  EXPECT_EQ(imu->dropped(), 0u);
  EXPECT_EQ(imu->published() - imu->popped(), kImuRing / 2);
}

TEST_F(EstimateStageTest, SpeedsAreTakenAsTheyCome) {
  for (int i = 0; i < 1000; ++i) {
    speeds.push({at_ms(10 * i), 1, 0});
    run(*stage);
  }
  EXPECT_EQ(speeds.dropped(), 0u);
  EXPECT_EQ(speeds.popped(), 1000u);
}

TEST_F(EstimateStageTest, EndsWhenTheLastImageIsDone) {
  imu_ended.set();
  show(0);
  show(50);
  tracker_ended.set();
  EXPECT_EQ(run(*stage).did, Step::Did::kEnd);
  EXPECT_EQ(stage->images(), 2u);
}

TEST_F(EstimateStageTest, InALoopNobodyPublishesAndTheLoopAsksForTheOutcome) {
  stage = std::make_unique<EstimateStage>(
      EstimateStageSettings{}, clock, EstimateStage::Inputs{*tracked, tracker_ended, *imu, imu_ended, speeds, heights},
      EstimateStage::Outputs{knowledge, tracker, *events});
  imu_ended.set();
  show(50);
  run(*stage);
  EXPECT_EQ(newest.read(), nullptr);
  EXPECT_EQ(stage->outcome().stamp, at_ms(50));
}

}  // namespace
}  // namespace epiline
