// The stages that read a device: IMU, camera and wheels.

#include "pipeline/stages/capture_stage.h"
#include "pipeline/stages/imu_stage.h"
#include "pipeline/stages/side_stage.h"
#include "tests/pipeline/stages/stage_support.h"

namespace epiline {
namespace {

using namespace test;

class ImuStageTest : public StageTest {
 protected:
  MadeUpImu imu;
  std::unique_ptr<ImuRing> one = std::make_unique<ImuRing>(), two = std::make_unique<ImuRing>();
  std::unique_ptr<ImuLogRing> log = std::make_unique<ImuLogRing>();
  Parking parking;
  Heard heard;
  ImuCorrection correction{.accelerometer = 1.25 * Mat3::Identity()};
  ImuStage stage{
      &imu, {100, 100}, correction, clock, {{{one.get(), &parking}, {two.get(), &parking}}, heard, *events, log.get()}};
};

TEST_F(ImuStageTest, EveryReaderAndTheLogGetEveryReading) {
  for (int i = 0; i < 200; ++i) imu.readings.push_back(reading_at(5 * i));
  run(stage);
  EXPECT_EQ(stage.readings(), 200u);
  for (const auto* ring : {one.get(), two.get()}) EXPECT_EQ(ring->published(), 200u);
  EXPECT_EQ(log->published(), 200u);
  EXPECT_EQ(heard.last(), at_ms(995));
  EXPECT_EQ(heard.period().ns, 5 * kMs);
  EXPECT_EQ(told(), Lines{});
}

TEST_F(ImuStageTest, ReadersGetCorrectedReadingsAndTheLogWhatCame) {
  imu.readings.push_back(reading_at(0));
  imu.readings[0].specific_force_m_s2 = {1, 2, 8};
  run(stage);
  ImuSample came, used;
  ASSERT_TRUE(log->pop(came));
  ASSERT_TRUE(two->pop(used));
  EXPECT_EQ(came.specific_force_m_s2, (std::array<double, 3>{1, 2, 8}));
  EXPECT_EQ(used.specific_force_m_s2, (std::array<double, 3>{1.25, 2.5, 10}));
}

TEST_F(ImuStageTest, AFullRingRefusesAndTheOthersGoOn) {
  for (int i = 0; i < 5000; ++i) {
    imu.readings.push_back(reading_at(5 * i));
    if (i < 1000) continue;  // the first thousand wait in both rings
    run(stage);
    two->pop();
  }
  run(stage);
  EXPECT_EQ(one->published(), kImuRing);
  EXPECT_EQ(one->dropped(), 5000 - kImuRing);
  EXPECT_EQ(two->published(), 5000u);
  EXPECT_EQ(two->dropped(), 0u);
}

TEST_F(ImuStageTest, AStampThatGoesBackIsLeftOutButLogged) {
  for (const int ms : {0, 5, 10, 4, 15}) imu.readings.push_back(reading_at(ms));
  for (ImuSample& reading : imu.readings) reading.arrival = {};
  run(stage);
  EXPECT_EQ(stage.readings(), 5u);
  EXPECT_EQ(log->published(), 5u);
  EXPECT_EQ(stage.watch().out_of_order, 1u);
  std::vector<HostStamp> stamps;
  for (ImuSample reading; one->pop(reading);) stamps.push_back(reading.stamp);
  EXPECT_EQ(stamps, (std::vector<HostStamp>{at_ms(0), at_ms(5), at_ms(10), at_ms(15)}));
  ASSERT_EQ(told().size(), 1u);
}

TEST_F(ImuStageTest, ALostDeviceIsToldOnceAndLeftAloneForAWhile) {
  imu.readings.push_back(reading_at(0));
  run(stage);
  imu.otherwise = ReadOutcome::kFailed;
  to_ms(20);
  EXPECT_EQ(sleeps_until_ms(stage), 30);
  EXPECT_EQ(sleeps_until_ms(stage), 30);
  EXPECT_EQ(told(), Lines{"20 source_lost source=imu"});
  imu.otherwise = ReadOutcome::kTimeout;  // not back yet
  to_ms(30);
  EXPECT_EQ(sleeps_until_ms(stage), 30) << "a device that waits itself is asked again at once";
  EXPECT_EQ(told(), Lines{});
  imu.readings.push_back(reading_at(40));
  to_ms(40);
  run(stage);
  EXPECT_EQ(told(), Lines{"40 source_found source=imu"});
  EXPECT_EQ(one->published(), 2u);
}

TEST_F(ImuStageTest, EndsWithTheRecording) {
  imu.readings.push_back(reading_at(0));
  imu.otherwise = ReadOutcome::kEnd;
  EXPECT_EQ(run(stage).did, Step::Did::kEnd);
  EXPECT_EQ(one->published(), 1u);
}

class CaptureStageTest : public StageTest {
 protected:
  std::vector<FrameRing::Value> in_ring() {
    std::vector<FrameRing::Value> slots;
    const auto overtaken = [&](FrameRing::Value slot) { slots.push_back(slot); };
    while (frames.ready()) slots.push_back(frames.pop(overtaken));
    return slots;
  }

  MadeUpCamera camera;
  LentImages images{&camera};
  FrameRing frames;
  Parking parking;
  Heard heard;
  CaptureStage stage{&camera, clock, {frames, images, parking, heard, *events}};
};

TEST_F(CaptureStageTest, WhatANewerImagePushesOutGoesBackAndIsTold) {
  camera.stamps_ms = {0, 50, 100, 150, 200, 250};
  run(stage);
  EXPECT_EQ(stage.images(), 6u);
  EXPECT_EQ(frames.evicted(), 2u);
  EXPECT_EQ(camera.away(), 4);
  EXPECT_EQ(told(), (Lines{"0 image_dropped sequence=0 reason=overtaken images=1",
                           "50 image_dropped sequence=1 reason=overtaken images=1"}));
  const auto slots = in_ring();
  ASSERT_EQ(slots.size(), 4u);
  EXPECT_EQ(images[slots.front()].stamp, at_ms(100));
  EXPECT_EQ(images[slots.back()].stamp, at_ms(250));
  EXPECT_EQ(heard.last(), at_ms(250));
}

TEST_F(CaptureStageTest, EachOtherCamerasImageIsJudgedForItself) {
  MadeUpCamera second, fourth;
  const Frame frozen = second.image(0);
  for (const int ms : {0, 50, 100, 150, 200}) {
    Frame image = camera.image(ms);
    ASSERT_TRUE(stage.admit(image));
    EXPECT_EQ(image.reasons, 0u);
    stage.hand_on(image, {frozen, Frame{}, fourth.image(ms)});
    const OtherFrames& others = images.others(static_cast<std::size_t>(image.slot));
    EXPECT_EQ(others[0].data != nullptr, ms == 0 || ms > 150) << "a copy, at first";
    EXPECT_EQ(is_blind(others[0].reasons), ms > 150) << "the same pixels as before";
    EXPECT_TRUE(others[0].data == nullptr || others[0].stamp == image.stamp);
    EXPECT_EQ(others[1].data, nullptr);
    EXPECT_FALSE(is_blind(others[2].reasons)) << "a new image each time";
  }
  EXPECT_EQ(told(), (Lines{"200 other_camera_blind on=1 images=1 camera=1",
                           "0 image_dropped sequence=0 reason=overtaken images=1"}));
  Frame image = camera.image(250);
  ASSERT_TRUE(stage.admit(image));
  stage.hand_on(image);
  EXPECT_EQ(images.others(static_cast<std::size_t>(image.slot))[0].data, nullptr);
}

/// Of a free-running camera; no farther apart than said.
TEST_F(CaptureStageTest, ASecondCamerasImageKeepsItsOwnTime) {
  CaptureStage free{&camera, clock, {frames, images, parking, heard, *events}, {Span::from_milliseconds(17)}};
  MadeUpCamera second;
  const auto beside = [&](int first_ms, int second_ms) {
    Frame image = camera.image(first_ms);
    EXPECT_TRUE(free.admit(image));
    free.hand_on(image, {second.image(second_ms)});
    return images.others(static_cast<std::size_t>(image.slot))[0];
  };
  EXPECT_EQ(beside(0, 17).stamp, at_ms(17));
  EXPECT_EQ(beside(50, 36).stamp, at_ms(36));
  EXPECT_EQ(beside(100, 118).data, nullptr) << "too far";
}

TEST_F(CaptureStageTest, AStampThatGoesBackGoesBackToTheCamera) {
  camera.stamps_ms = {0, 50, 20, 100};
  run(stage);
  EXPECT_EQ(stage.images(), 4u);
  EXPECT_EQ(stage.refused(), 1u);
  EXPECT_EQ(camera.returned, 1);
  EXPECT_EQ(in_ring().size(), 3u);
  EXPECT_EQ(told(), Lines{"50 image_dropped sequence=2 reason=refused images=1"});
}

TEST_F(CaptureStageTest, AGapInTheSequenceIsTold) {
  camera.stamps_ms = {0};
  run(stage);
  camera.sequence = 4;
  camera.stamps_ms = {0, 200};
  run(stage);
  EXPECT_EQ(told(), Lines{"200 image_dropped sequence=1 reason=missed images=3"});
}

TEST_F(CaptureStageTest, ASilentCameraIsAskedAgainAndALostOneLeftAlone) {
  EXPECT_EQ(sleeps_until_ms(stage), 0);
  EXPECT_EQ(heard.last().ns, 0);
  camera.otherwise = ReadOutcome::kFailed;
  EXPECT_EQ(sleeps_until_ms(stage), 10);
  EXPECT_EQ(told(), Lines{"0 source_lost source=camera"});
  camera.otherwise = ReadOutcome::kEnd;
  EXPECT_EQ(run(stage).did, Step::Did::kEnd);
}

/// Numbers its only image's buffer as a test says.
class NumberingCamera final : public CameraSource {
 public:
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(Frame& frame, Span) noexcept override {
    if (slot == kNone) return ReadOutcome::kTimeout;
    frame = {};
    frame.stamp = frame.arrival = at_ms(0);
    frame.slot = std::exchange(slot, kNone);
    return ReadOutcome::kSample;
  }
  void give_back(const Frame& /*frame*/) noexcept override {}
  static constexpr int kNone = -1000;
  int slot = kNone;
};

class CaptureStageDeathTest : public StageTest {
 protected:
  void give(int slot) {
    NumberingCamera camera;
    LentImages images{&camera};
    FrameRing frames;
    Parking parking;
    Heard heard;
    CaptureStage stage{&camera, clock, {frames, images, parking, heard, *events}};
    camera.slot = slot;
    run(stage);
    EXPECT_EQ(frames.pop([](FrameRing::Value) {}), static_cast<FrameRing::Value>(slot));
  }
};

TEST_F(CaptureStageDeathTest, ABufferBeyondTheLastNumberIsABugOfTheCamera) {
  give(0);
  give(255);
  for (const int slot : {-1, 256}) EXPECT_DEATH(give(slot), "a camera numbers its buffers from 0 to 255") << slot;
}

TEST(LentImagesTest, TheLastUserGivesTheImageBack) {
  MadeUpCamera camera;
  LentImages images(&camera);
  const Frame image = camera.image(0);
  images.lend(image);
  images.share(static_cast<std::size_t>(image.slot));
  images.give_back(static_cast<std::size_t>(image.slot));
  EXPECT_EQ(camera.away(), 1);
  images.give_back(static_cast<std::size_t>(image.slot));
  EXPECT_EQ(camera.away(), 0);
}

class MadeUpWheel final : public WheelSource {
 public:
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(WheelSample& sample, Span) noexcept override {
    if (left == 0) return ReadOutcome::kTimeout;
    sample = {at_ms(--left), 1.0, 0};
    return ReadOutcome::kSample;
  }
  int left = 0;
};

TEST_F(StageTest, WheelsEndWithTheOthersAndAFullRingRefusesTheirSpeeds) {
  MadeUpWheel wheel;
  EndMark imu_ended, camera_ended;
  auto speeds = std::make_unique<WheelRing>();
  auto log = std::make_unique<WheelLogRing>();
  SideStage<WheelSample> stage(EventSource::kWheel, {&wheel, imu_ended, camera_ended}, clock, {*speeds, *events, *log});
  wheel.left = 300;
  run(stage);
  EXPECT_EQ(stage.samples(), 300u);
  EXPECT_EQ(speeds->published(), 256u);
  EXPECT_EQ(speeds->dropped(), 44u);
  EXPECT_EQ(log->published(), 300u);
  imu_ended.set();
  EXPECT_EQ(run(stage).did, Step::Did::kNothing);
  camera_ended.set();
  EXPECT_EQ(run(stage).did, Step::Did::kEnd);
}

}  // namespace
}  // namespace epiline
