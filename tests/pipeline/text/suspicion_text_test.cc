// The words for numbers that cannot be true.
#include "pipeline/text/suspicion_text.h"

#include <gtest/gtest.h>

#include <string>

namespace epiline {
namespace {

bool says(const std::string& text, const char* what) { return text.find(what) != std::string::npos; }

TEST(SuspicionText, NamesTheNumberAndTheFigure) {
  EXPECT_TRUE(says(text_of(Suspect::kRotation, {Severity::kSuspect, 0.157, {}}), "by 9 degrees"));
  EXPECT_TRUE(says(text_of(Suspect::kInverted, {Severity::kGross, 0, {}}), "T_cam_imu) is inverted"));
  EXPECT_TRUE(says(text_of(Suspect::kWheelScale, {Severity::kNote, 1 / 1.05, {}}), "wheels read 5.0 % too much"));
  EXPECT_TRUE(says(text_of(Suspect::kWheelScale, {Severity::kNote, -1, {}}), "backwards"));
  EXPECT_TRUE(says(text_of(Suspect::kWheelScale, {Severity::kNote, 0.277, {}}), "km/h"));
  EXPECT_TRUE(says(text_of(Suspect::kWheelSlip, {Severity::kNote, 0.2, {}}), "20 %"));
  EXPECT_TRUE(says(text_of(Suspect::kWheelStuck, {Severity::kNote, 1, {}}), "1.00 m/s while the vehicle's speed"));
  EXPECT_TRUE(says(text_of(Suspect::kWheelDelay, {Severity::kNote, 0.3, {}}), "late by 0.30 s"));
  EXPECT_TRUE(says(text_of(Suspect::kPlace, {Severity::kNote, 0.19, {}}), "19 cm from where T_BS puts it"));
  EXPECT_TRUE(says(text_of(Suspect::kTimeOffset, {Severity::kGross, -0.048, {}}), "late by 48 ms"));
  EXPECT_TRUE(says(text_of(Suspect::kGyroscopeUnits, {Severity::kGross, 57.3, {}}), "in degrees"));
  EXPECT_TRUE(says(text_of(Suspect::kAccelerometerUnits, {Severity::kGross, 1.0, {}}), "in g?"));
  EXPECT_TRUE(says(text_of(Suspect::kMirrored, {Severity::kGross, 1, {2, 1, 3}}), "axes x and y look swapped"));
  EXPECT_TRUE(says(text_of(Suspect::kMirrored, {Severity::kGross, 1, {1, 2, -3}}), "sign of its z axis"));
  EXPECT_TRUE(says(text_of(Suspect::kMirrored, {Severity::kGross, 1, {-1, -2, -3}}), "mirrored"));
  EXPECT_TRUE(says(text_of(Suspect::kImuMisfit, {Severity::kSuspect, 1.4, {}}), "more than its noise"));
  EXPECT_TRUE(says(text_of(Suspect::kBehind, {Severity::kGross, 0.62, {}}), "62 % of the tracks meet behind it"));
  EXPECT_TRUE(says(text_of(Suspect::kGyroscopeNoise, {Severity::kNote, 40, {}}), "off by 40"));
  EXPECT_TRUE(says(text_of(Suspect::kGyroscopeNoise, {Severity::kNote, 40, {}}), "corrects for it"));
  EXPECT_TRUE(says(text_of(Suspect::kGyroscopeScale, {Severity::kNote, 1 / 1.03, {}}),
                   "gyroscope's readings are 3.0 % too large"));
  EXPECT_TRUE(says(text_of(Suspect::kAccelerometerScale, {Severity::kNote, 1.02, {}}), "2.0 % too small"));
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
  EXPECT_STREQ(to_string(Suspect::kRotation), "camera_rotation");
  EXPECT_STREQ(to_string(Suspect::kInverted), "camera_rotation_inverted");
  EXPECT_STREQ(to_string(Suspect::kPlace), "camera_place");
  EXPECT_STREQ(to_string(Suspect::kMirrored), "axes_mirrored");
  EXPECT_STREQ(to_string(Suspect::kTimeOffset), "time_offset");
  EXPECT_STREQ(to_string(Suspect::kGyroscopeUnits), "gyroscope_units");
  EXPECT_STREQ(to_string(Suspect::kScale), "rotation_scale");
  EXPECT_STREQ(to_string(Suspect::kUnrelated), "turns_unrelated");
  EXPECT_STREQ(to_string(Suspect::kAccelerometerUnits), "accelerometer_units");
  EXPECT_STREQ(to_string(Suspect::kMisfit), "misfit");
  EXPECT_STREQ(to_string(Suspect::kImuMisfit), "imu_misfit");
  EXPECT_STREQ(to_string(Suspect::kBehind), "tracks_behind");
  EXPECT_STREQ(to_string(Suspect::kGyroscopeNoise), "gyroscope_noise");
  EXPECT_STREQ(to_string(Suspect::kAccelerometerNoise), "accelerometer_noise");
  EXPECT_STREQ(to_string(Suspect::kFocalLength), "focal_length");
  EXPECT_STREQ(to_string(Suspect::kAccelerometerScale), "accelerometer_scale");
  EXPECT_STREQ(to_string(Suspect::kGyroscopeScale), "gyroscope_scale");
  EXPECT_STREQ(to_string(Severity::kNone), "none");
  EXPECT_STREQ(to_string(Severity::kNote), "corrected");
  EXPECT_STREQ(to_string(Severity::kSuspect), "suspect");
  EXPECT_STREQ(to_string(Severity::kGross), "gross");
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
