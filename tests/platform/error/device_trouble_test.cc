#include "platform/error/device_trouble.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <cstdio>
#include <string>

namespace epiline {
namespace {

TEST(DeviceTrouble, IsNoneUntilAStepIsNamed) {
  EXPECT_FALSE(DeviceTrouble{});
  EXPECT_TRUE(device_refusal("open", 0));
}

TEST(DeviceTrouble, TextSaysWhatHappenedAndWhatToDo) {
  const auto text_of = [](const DeviceTrouble& trouble) { return error_of(trouble, "/dev/it").text(); };
  EXPECT_EQ(text_of(device_refusal("reset", EIO)), "/dev/it: Input/output error [reset]");
  EXPECT_EQ(text_of(device_refusal("no such thing", 0)), "/dev/it: no such thing");
  EXPECT_EQ(text_of(device_refusal("open", EIO, "a device")), "/dev/it: Input/output error [open]; expected a device");
  for (const int error : {ENOENT, ENODEV, ENXIO, EACCES, EPERM, EBUSY}) {
    EXPECT_NE(text_of(device_refusal("open", error)).find("; expected "), std::string::npos) << error;
    EXPECT_NE(text_of(device_refusal("open", error, "that")).find("; expected that"), std::string::npos) << error;
  }
  DeviceTrouble trouble = device_refusal("rate", EINVAL);
  std::snprintf(trouble.found, sizeof trouble.found, "7 Hz");
  EXPECT_EQ(text_of(trouble), "/dev/it: 7 Hz: Invalid argument [rate]");
}

TEST(DeviceTrouble, ATextThatIsTooLongIsCut) {
  const std::string longest(sizeof(DeviceTrouble::expected) - 1, 'x');
  EXPECT_EQ(device_refusal("open", 0, longest.c_str()).expected, longest);
  EXPECT_EQ(device_refusal("open", 0, (longest + "y").c_str()).expected, longest);
}

}  // namespace
}  // namespace epiline
