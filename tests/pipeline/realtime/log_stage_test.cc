#include "pipeline/realtime/log_stage.h"

#include "tests/pipeline/stages/stage_support.h"

namespace epiline {
namespace {

using namespace test;

struct Listener final : FlightObserver {
  void take(const FrameOutcome&) noexcept override { ++outcomes; }
  void image(const Frame&, const OtherFrames&) noexcept override { ++images; }
  void event(const Event& event) noexcept override { last = event; }
  void pass(HostStamp) noexcept override { ++passes; }
  bool wants_images() const noexcept override { return true; }
  int outcomes = 0, images = 0, passes = 0;
  Event last;
};

class LogStageTest : public StageTest {
 protected:
  Listener listener;
  MadeUpCamera camera;
  LentImages images{&camera};
  std::unique_ptr<FlightLog> log =
      std::make_unique<FlightLog>(std::vector<FlightObserver*>{&listener}, std::vector<EventRing*>{}, 2);
  EndMark one, two, three;
  std::unique_ptr<ImuRing> imu = std::make_unique<ImuRing>();
  WheelRing speeds;
  HeightRing heights;
  LogStage stage{clock,
                 {*log,
                  images,
                  {&one, &two, &three},
                  {{{RingName::kImuToTrack, imu.get()},
                    {RingName::kImuToEstimate, imu.get()},
                    {RingName::kImuToPublish, imu.get()}}},
                  speeds,
                  heights}};
};

TEST_F(LogStageTest, HandsOnWhatHasComeAndGivesImagesBack) {
  EXPECT_EQ(sleeps_until_ms(stage), 100);
  EXPECT_EQ(listener.passes, 1);
  const Frame image = camera.image(0);
  images.lend(image);
  ASSERT_TRUE(log->images().push(image));
  ASSERT_TRUE(log->outcomes().push({}));
  EXPECT_TRUE(stage.ready());
  run(stage);
  EXPECT_EQ(listener.outcomes, 1);
  EXPECT_EQ(listener.images, 1);
  EXPECT_EQ(camera.away(), 0);
}

TEST_F(LogStageTest, TellsOfLossesElsewhere) {
  for (int i = 0; i < 5000; ++i) imu->push(reading_at(i));
  run(stage);
  to_ms(1000);  // events are kept back for half a second: an earlier one may still come
  run(stage);
  EXPECT_EQ(listener.last.id, EventId::kRingOverflow);
  EXPECT_EQ(listener.last.args[1], 5000 - static_cast<std::int64_t>(kImuRing));
}

TEST_F(LogStageTest, EndsAfterTheLastOfItsWritersWithEverythingHandedOn) {
  one.set();
  two.set();
  EXPECT_EQ(run(stage).did, Step::Did::kNothing);
  log->outcomes().push({});
  log->events_of(FlightLog::Speaker::kTrack).push({at_ms(1), EventId::kReset, {}});
  three.set();
  EXPECT_TRUE(stage.ready());
  EXPECT_EQ(run(stage).did, Step::Did::kEnd);
  EXPECT_EQ(listener.outcomes, 1);
  EXPECT_EQ(listener.last.id, EventId::kReset) << "not kept back any more";
}

}  // namespace
}  // namespace epiline
