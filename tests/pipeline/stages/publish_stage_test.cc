#include "pipeline/stages/publish_stage.h"

#include <vector>

#include "tests/pipeline/stages/stage_support.h"

namespace epiline {
namespace {

using namespace test;

class MadeUpReceiver final : public OdometrySink {
 public:
  MadeUpReceiver() {
    rates.reserve(10'000);
    images.reserve(1'000);
  }
  Status open() override { return Done{}; }
  void close() noexcept override {}
  bool publish(const Odometry& odometry) noexcept override {
    rates.push_back(odometry);
    return !refuses;
  }
  bool publish_image(const Odometry& odometry) noexcept override {
    images.push_back(odometry);
    return !refuses;
  }
  std::vector<Odometry> rates, images;
  bool refuses = false;
};

bool has(const Odometry& odometry, HealthReason reason) { return (odometry.health.reasons & bit(reason)) != 0; }

class PublishStageTest : public StageTest {
 protected:
  /// A solved image, or one that was only predicted. The body rests at (1, 2, 3).
  void estimate(std::int64_t ms, bool solved = true, std::uint32_t resets = 0, bool has_pose = true) {
    Odometry o;
    o.stamp = at_ms(ms);
    o.p_WB_m = {1, 2, 3};
    o.reset_counter = resets;
    o.health = health;
    for (std::size_t i = 0; i < 16; ++i) o.covariance[17 * i] = 1e-4;
    Estimate& draft = newest.draft();
    draft.serial = ++serial;
    draft.has_pose = has_pose;
    draft.odometry = o;
    if (solved) {
      solved_serial = serial;
      last_solved = o;
    }
    draft.solved_serial = solved_serial;
    draft.solved = last_solved;
    newest.publish();
  }
  /// Readings of rest, with the clock at each one's stamp.
  void feed(std::int64_t from_ms, std::int64_t until_ms) {
    for (; from_ms <= until_ms; from_ms += 5) {
      ImuSample reading;
      reading.stamp = at_ms(from_ms);
      reading.specific_force_m_s2 = {0, 0, 9.81};
      imu->push(reading);
      imu_heard.tell(reading.stamp, Span::from_milliseconds(5));
    }
  }
  void see(std::int64_t ms) { camera_heard.tell(at_ms(ms), Span::from_milliseconds(50)); }
  /// A flight up to 100 ms in which everything was handed out.
  void fly() {
    feed(0, 100);
    see(100);
    to_ms(100);
    estimate(90);
    run(stage);
    receiver.rates.clear();
  }

  LatestValue<Estimate> newest;
  EndMark estimator_ended, camera_ended, imu_ended;
  std::unique_ptr<ImuRing> imu = std::make_unique<ImuRing>();
  Heard camera_heard, imu_heard;
  MadeUpReceiver receiver;
  PublicationRing publications;
  Parking log;
  std::uint64_t serial = 0, solved_serial = 0;
  Odometry last_solved;
  Health health{HealthState::kTracking, 0, 90};  ///< of the next estimate
  PublishStage stage{{},
                     30,
                     clock,
                     {newest, estimator_ended, *imu, camera_heard, camera_ended, imu_heard, imu_ended},
                     {&receiver, publications, log}};
};

TEST_F(PublishStageTest, AReadingAfterTheFirstPoseBringsAnOdometryOfItsInstant) {
  feed(0, 50);
  EXPECT_EQ(sleeps_until_ms(stage), 100);
  EXPECT_TRUE(receiver.rates.empty()) << "no pose yet";
  estimate(40);
  see(40);
  to_ms(60);
  feed(55, 75);
  EXPECT_TRUE(stage.ready());
  run(stage);
  ASSERT_EQ(receiver.images.size(), 1u);
  EXPECT_EQ(receiver.images[0].stamp, at_ms(40));
  ASSERT_EQ(receiver.rates.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(receiver.rates[i].stamp, at_ms(55 + 5 * static_cast<std::int64_t>(i)));
    EXPECT_NEAR(receiver.rates[i].p_WB_m[2], 3, 1e-3);
    EXPECT_EQ(receiver.rates[i].health.state, HealthState::kTracking);
  }
  EXPECT_EQ(stage.counts().predicted.get(), 5u);
  EXPECT_EQ(stage.prediction_latency().count(), 5u);
}

TEST_F(PublishStageTest, TheNewestImageIsHandedOutOnceAndItsLatencyTold) {
  feed(0, 100);
  to_ms(90);
  estimate(40);
  estimate(70, false);  // supersedes the one before; what that one solved still corrects
  run(stage);
  run(stage);
  ASSERT_EQ(receiver.images.size(), 1u);
  EXPECT_EQ(receiver.images[0].stamp, at_ms(70));
  EXPECT_EQ(stage.counts().published.get(), 1u);
  EXPECT_EQ(stage.counts().late.get(), 0u);
  EXPECT_EQ(stage.prediction().corrections, 1u);
  estimate(55);
  run(stage);
  EXPECT_EQ(stage.counts().late.get(), 1u) << "35 ms, 30 allowed";
  Publication told_of;
  ASSERT_TRUE(publications.pop(told_of));
  EXPECT_EQ(told_of.serial, 1u);
  EXPECT_EQ(told_of.latency_ns, 20 * kMs);
}

TEST_F(PublishStageTest, AResetForgetsThePredictionUntilTheNextSolve) {
  fly();
  estimate(100, false, 1);
  feed(105, 105);
  run(stage);
  EXPECT_TRUE(receiver.rates.empty());
  estimate(105, true, 1);
  feed(110, 110);
  run(stage);
  ASSERT_EQ(receiver.rates.size(), 1u);
  EXPECT_EQ(receiver.rates[0].reset_counter, 1u);
}

TEST_F(PublishStageTest, WhileTheImuIsSilentTheLastPredictionGoesOutTenTimesASecond) {
  fly();
  to_ms(150);
  EXPECT_EQ(sleeps_until_ms(stage), 200);
  EXPECT_TRUE(receiver.rates.empty()) << "not silent for long";
  for (std::int64_t ms = 200; ms <= 500; ms += 10) {
    to_ms(ms);
    run(stage);
    EXPECT_EQ(receiver.rates.size(), static_cast<std::size_t>((ms - 100) / 100)) << ms;
  }
  for (const Odometry& odometry : receiver.rates) {
    EXPECT_EQ(odometry.stamp, at_ms(100));
    EXPECT_TRUE(has(odometry, HealthReason::kImuSilent));
    EXPECT_EQ(odometry.health.state, HealthState::kDegraded);
  }
  receiver.rates.clear();
  estimate(500, false, 0, false);  // and at each image without a pose
  run(stage);
  EXPECT_EQ(receiver.rates.size(), 1u);
  receiver.rates.clear();
  camera_ended.set();
  imu_ended.set();
  to_ms(900);
  run(stage);
  EXPECT_TRUE(receiver.rates.empty()) << "a recording that is over is no silence";
}

TEST_F(PublishStageTest, ASilentCameraShowsInEveryPrediction) {
  fly();
  to_ms(250);
  feed(105, 250);
  run(stage);
  ASSERT_EQ(receiver.rates.size(), 30u);
  EXPECT_TRUE(has(receiver.rates.back(), HealthReason::kCameraSilent));
  to_ms(2'200);
  feed(255, 2'200);
  run(stage);
  EXPECT_EQ(receiver.rates.back().health.state, HealthState::kLost);
}

// An image between two solves may be worse than the last solve.
TEST_F(PublishStageTest, APredictionHasTheHealthOfTheNewestImage) {
  fly();
  health = {HealthState::kDegraded, bit(HealthReason::kFewTracks), 40};
  estimate(100, false);
  feed(105, 105);
  to_ms(105);
  run(stage);
  ASSERT_EQ(receiver.rates.size(), 1u);
  EXPECT_EQ(receiver.rates[0].health.state, HealthState::kDegraded);
  EXPECT_TRUE(has(receiver.rates[0], HealthReason::kFewTracks));
  EXPECT_EQ(receiver.rates[0].health.quality, 40);
}

// And the last solve must not vouch for a prediction that nothing has corrected for long.
TEST_F(PublishStageTest, AnOldSolveDegradesThePredictionWhateverTheImagesSay) {
  fly();
  to_ms(900);
  feed(105, 900);
  see(900);
  estimate(890, false);
  run(stage);
  EXPECT_EQ(receiver.rates.back().health.state, HealthState::kDegraded);
  EXPECT_TRUE(has(receiver.rates.back(), HealthReason::kDeadlineMissed));
}

TEST_F(PublishStageTest, AReceiverThatRefusesIsCounted) {
  receiver.refuses = true;
  fly();
  feed(105, 120);
  run(stage);
  EXPECT_EQ(stage.counts().publish_failed.get(), 1u);
  EXPECT_EQ(stage.counts().predict_failed.get(), stage.counts().predicted.get());
  EXPECT_GE(stage.counts().predicted.get(), 4u);
}

TEST_F(PublishStageTest, AFullLogLosesItsCopyAndTheReceiverNothing) {
  for (int i = 0; i < 300; ++i) {
    estimate(50 * i, false);
    run(stage);
  }
  EXPECT_EQ(receiver.images.size(), 300u);
  EXPECT_EQ(publications.dropped(), 44u);
}

TEST_F(PublishStageTest, EndsWhenAllIsHandedOut) {
  feed(0, 50);
  estimate(40);
  estimator_ended.set();
  EXPECT_EQ(run(stage).did, Step::Did::kEnd);
  EXPECT_EQ(receiver.images.size(), 1u);
  EXPECT_EQ(imu->front(), nullptr);
}

}  // namespace
}  // namespace epiline
