#include "drivers/program/check/hand_wave.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/flights/recordings/image_file.h"
#include "drivers/program/check/image_check.h"
#include "drivers/program/check/imu_check.h"
#include "estimator/geometry/so3.h"
#include "tests/drivers/study/calibrate/waved_rig.h"
#include "tests/support/made_up_wave.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

using test::MadeUpWave;

TurnAgreement agreement_of(const MadeUpWave& made) {
  HandWave wave(0);
  made.play(wave);
  return wave.agreement();
}

TEST(HandWave, FindsTimeOffsetAndRotation) {
  for (const double offset : {0.037, -0.012, 0.}) {
    MadeUpWave made;
    made.offset_s = offset;
    const TurnAgreement r = agreement_of(made);
    EXPECT_NEAR(r.time_offset_s, offset, 0.0015);
    EXPECT_LT(so3_log(made.R_BC.transpose() * r.R_BC).norm(), 0.01);
    EXPECT_GT(r.agreement, 0.99);
    EXPECT_GT(r.weakest_axis, 0.5);
  }
}

TEST(HandWave, SaysWhatIsWrong) {
  const MadeUpWave made;
  const TurnAgreement r = agreement_of(made);
  const Findings right = findings_of(r, made.R_BC, made.offset_s);
  for (const Finding& f : right) EXPECT_EQ(f.grade, Grade::kOk) << f.text;
  EXPECT_EQ(findings_of(r, made.R_BC, 0)[0].grade, Grade::kError);
  EXPECT_NE(findings_of(r, made.R_BC, 0)[0].remedy.find("camera.time_offset_s = 0.03"), std::string::npos);
  const Findings inverted = findings_of(r, made.R_BC.transpose(), made.offset_s);
  EXPECT_EQ(inverted[1].grade, Grade::kError);
  EXPECT_NE(inverted[1].remedy.find("axes are swapped"), std::string::npos);
}

TEST(HandWave, SaysWhenItCannotKnow) {
  MadeUpWave still, no_readings, one_axis, chance;
  still.size = 0.02;
  no_readings.has_readings = false;
  for (const MadeUpWave& made : {still, no_readings})
    EXPECT_EQ(findings_of(agreement_of(made), made.R_BC, 0)[0].text,
              "not turned: time offset and rotation not checked");
  one_axis.one_axis = true;
  const Findings f = findings_of(agreement_of(one_axis), one_axis.R_BC, one_axis.offset_s);
  EXPECT_EQ(f[0].grade, Grade::kOk) << "the time is known";
  EXPECT_EQ(f[1].grade, Grade::kWarning);
  chance.parallax = 0.5;
  EXPECT_NE(findings_of(agreement_of(chance), chance.R_BC, chance.offset_s)[0].grade, Grade::kOk);
  EXPECT_EQ(findings_of(HandWave(0).agreement(), Mat3::Identity(), 0)[0].grade, Grade::kWarning) << "nothing at all";
}

TEST(HandWave, AnHourAtRestBeforeItDoesNotHideIt) {
  const MadeUpWave made;
  HandWave wave(0);
  ImuSample reading;
  for (std::size_t i = 0; i < 800'000; ++i) {
    reading.stamp = {1'000 * static_cast<std::int64_t>(i)};
    wave.add_reading(reading);
  }
  made.play(wave);
  EXPECT_NEAR(wave.agreement().time_offset_s, made.offset_s, 0.0015);
}

/// The corners of a board are all that the camera sees.
TurnAgreement before_a_board(const WavedRig& rig) {
  HandWave wave(0);
  const Camera camera(rig.lens);
  const std::vector<ImuSample> readings = rig.readings();
  auto next = readings.begin();
  for (const CornerView& view : rig.views()) {
    TrackedFrame frame;
    frame.stamp = view.stamp;
    for (const BoardCorner& corner : view.corners) {
      Vec3 f_C;
      camera.unproject(corner.px, f_C);
      TrackedFeature feature;
      feature.id = corner.id;
      Vec3::Map(feature.bearing.data()) = f_C.normalized();
      frame.features.push_back(feature);
    }
    while (next != readings.end() && next->stamp <= view.stamp) wave.add_reading(*next++);
    wave.add_images(frame);
  }
  return wave.agreement();
}

// Two rotations explain two images of a plane. Taken at random, they made a right rig an error.
TEST(HandWave, ARightRigBeforeABoardIsRight) {
  for (const double distance_m : {0.3, 0.5, 0.8}) {
    WavedRig rig;
    rig.distance_m = distance_m;
    const TurnAgreement r = before_a_board(rig);
    EXPECT_GT(r.turned_s, 8) << distance_m;
    EXPECT_GT(r.agreement, 0.95) << distance_m;
    EXPECT_LT(so3_log(rig.R_BC.transpose() * r.R_BC).norm(), 0.03) << distance_m;
    for (const Finding& f : findings_of(r, rig.R_BC, rig.time_offset_s))
      EXPECT_EQ(f.grade, Grade::kOk) << distance_m << ": " << f.text;
  }
}

// A real flight, whose camera and IMU are synchronised in hardware and calibrated.
TEST(HandWave, OfARecordedFlightIsAsCalibrated) {
  const std::filesystem::path folder = test::recorded_data("euroc_MH_01");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const auto dataset = open_asl_dataset(folder, "cam0");
  ASSERT_TRUE(dataset) << dataset.error().text();
  ImageCheck images(Camera(dataset->camera.parameters), {});
  ImuCheck readings;
  HandWave wave(0);
  for (const ImuSample& s : dataset->imu_samples) readings.step(s);
  std::size_t next = 0;
  ImageDecoder decoder;
  for (std::size_t i = 0; i < std::min<std::size_t>(400, dataset->images.size()); ++i) {
    const auto frame = decoder.read(i, *dataset);
    ASSERT_TRUE(frame) << frame.error().text();
    while (next < dataset->imu_samples.size() && dataset->imu_samples[next].stamp <= frame->stamp)
      wave.add_reading(dataset->imu_samples[next++]);
    wave.add_images(images.step(*frame));
  }
  const TurnAgreement r = wave.agreement();
  const double angle = so3_log(dataset->camera.R_BC.transpose() * r.R_BC).norm() * 57.3;
  EXPECT_NEAR(r.time_offset_s, dataset->camera.time_offset_s, 0.006);
  EXPECT_LT(angle, 7);
  for (const Finding& f : findings_of(images.result(), 20, 150)) EXPECT_EQ(f.grade, Grade::kOk) << f.text;
  for (const Finding& f : findings_of(readings.result(), {200, 1.7e-4, 2e-3}))
    EXPECT_NE(f.grade, Grade::kError) << f.text;
}

}  // namespace
}  // namespace epiline
