// The words for numbers that cannot be true.
#include "pipeline/text/suspicion_text.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>

namespace epiline {
namespace {

bool says(const std::string& text, const char* what) { return text.find(what) != std::string::npos; }

TEST(SuspicionText, NamesTheNumberAndTheFigure) {
  using enum Suspect;
  using enum Severity;
  const struct {
    Suspect suspect;
    Suspicion suspicion;
    const char* what;
  } cases[] = {
      {kRotation, {kSuspect, 0.157, {}}, "by 9 degrees"},
      {kInverted, {kGross, 0, {}}, "T_cam_imu) is inverted"},
      {kWheelScale, {kNote, 1 / 1.05, {}}, "wheels read 5.0 % too much"},
      {kWheelScale, {kNote, -1, {}}, "backwards"},
      {kWheelScale, {kNote, 0.277, {}}, "km/h"},
      {kWheelSlip, {kNote, 0.2, {}}, "20 %"},
      {kWheelStuck, {kNote, 1, {}}, "1.00 m/s while the vehicle's speed"},
      {kWheelDelay, {kNote, 0.3, {}}, "late by 0.30 s"},
      {kPlace, {kNote, 0.19, {}}, "19 cm from where T_BS puts it"},
      {kTimeOffset, {kGross, -0.048, {}}, "late by 48 ms"},
      {kGyroscopeUnits, {kGross, 57.3, {}}, "in degrees"},
      {kAccelerometerUnits, {kGross, 1.0, {}}, "in g?"},
      {kMirrored, {kGross, 1, {2, 1, 3}}, "axes x and y look swapped"},
      {kMirrored, {kGross, 1, {1, 2, -3}}, "sign of its z axis"},
      {kMirrored, {kGross, 1, {-1, -2, -3}}, "mirrored"},
      {kImuMisfit, {kSuspect, 1.4, {}}, "more than its noise"},
      {kBehind, {kGross, 0.62, {}}, "62 % of the tracks meet behind it"},
      {kGyroscopeNoise, {kNote, 40, {}}, "off by 40"},
      {kGyroscopeNoise, {kNote, 40, {}}, "corrects for it"},
      {kLensShape, {kNote, 0.97, {}}, "3.0 % nearer in than configured"},
      {kGyroscopeScale, {kNote, 1 / 1.03, {}}, "gyroscope's readings are 3.0 % too large"},
      {kAccelerometerScale, {kNote, 1.02, {}}, "2.0 % too small"},
  };
  for (const auto& [suspect, suspicion, what] : cases)
    EXPECT_TRUE(says(text_of(suspect, suspicion), what)) << text_of(suspect, suspicion);
}

TEST(SuspicionText, GrossOnesComeFirst) {
  Suspicions s;
  EXPECT_TRUE(texts_of(s).empty());
  s[static_cast<std::size_t>(Suspect::kRotation)] = {Severity::kNote, 0.1, {}};
  s[static_cast<std::size_t>(Suspect::kAccelerometerUnits)] = {Severity::kGross, 1, {}};
  ASSERT_EQ(texts_of(s).size(), 2U);
  EXPECT_TRUE(says(texts_of(s)[0], "in g?"));
}

TEST(SuspicionText, TheWordsForProgramsStay) {
  using enum Suspect;
  const std::pair<Suspect, const char*> suspects[] = {{kRotation, "camera_rotation"},
                                                      {kInverted, "camera_rotation_inverted"},
                                                      {kPlace, "camera_place"},
                                                      {kMirrored, "axes_mirrored"},
                                                      {kTimeOffset, "time_offset"},
                                                      {kGyroscopeUnits, "gyroscope_units"},
                                                      {kScale, "rotation_scale"},
                                                      {kUnrelated, "turns_unrelated"},
                                                      {kAccelerometerUnits, "accelerometer_units"},
                                                      {kMisfit, "misfit"},
                                                      {kImuMisfit, "imu_misfit"},
                                                      {kBehind, "tracks_behind"},
                                                      {kGyroscopeNoise, "gyroscope_noise"},
                                                      {kAccelerometerNoise, "accelerometer_noise"},
                                                      {kFocalLength, "focal_length"},
                                                      {kLensShape, "lens_shape"},
                                                      {kAccelerometerScale, "accelerometer_scale"},
                                                      {kGyroscopeScale, "gyroscope_scale"}};
  for (const auto& [suspect, word] : suspects) EXPECT_STREQ(to_string(suspect), word);
  const std::pair<Severity, const char*> severities[] = {{Severity::kNone, "none"},
                                                         {Severity::kNote, "corrected"},
                                                         {Severity::kSuspect, "suspect"},
                                                         {Severity::kGross, "gross"}};
  for (const auto& [severity, word] : severities) EXPECT_STREQ(to_string(severity), word);
}

TEST(SuspicionText, AnEventSaysTheSame) {
  for (int i = 0; i < static_cast<int>(Suspect::kCount); ++i) {
    const auto suspect = static_cast<Suspect>(i);
    for (const Severity severity : {Severity::kNote, Severity::kSuspect, Severity::kGross}) {
      const Suspicion s{severity, 0.75, {3, -2, 1}};
      EXPECT_EQ(text_of(event_of({}, suspect, s)), text_of(suspect, s)) << i;
      char text[128];
      const std::string event(text, format_event(event_of({}, suspect, s), text));
      const std::string words = std::string("what=") + to_string(suspect) + " severity=" + to_string(severity);
      EXPECT_TRUE(says(event, words.c_str())) << event;
    }
  }
}

}  // namespace
}  // namespace epiline
