// Which line is meant. The lines themselves are tested in tests/hardware, against the kernel's gpio-sim.
#include "drivers/sensors/gpio/gpio_line.h"

#include <gtest/gtest.h>

#include <vector>

#include "drivers/sensors/gpio/gpio_request.h"

namespace epiline {
namespace {

const std::vector<GpioChipFacts> kChips{
    {"/dev/gpiochip0", "gpiochip0", "pinctrl-rp1", {{"ID_SDA", ""}, {"GPIO4", ""}, {"", ""}}},
    {"/dev/gpiochip1", "gpiochip1", "adapter", {{"strobe", ""}, {"a:1", ""}, {"twice", ""}}},
    {"/dev/gpiochip2", "gpiochip2", "adapter", {{"twice", ""}}},
    {"/dev/gpiochip3", "gpiochip3", "gpiochip0", {{"", ""}, {"", ""}}},
};

std::string chosen(const std::string& wanted) {
  const auto choice = choose_line(kChips, wanted);
  return choice ? choice->chip->path + " " + std::to_string(choice->offset) : choice.error().text();
}

TEST(GpioLine, IsFoundByNameThenByLabelThenByNameOfItsChip) {
  EXPECT_EQ(chosen("GPIO4"), "/dev/gpiochip0 1");
  EXPECT_EQ(chosen("a:1"), "/dev/gpiochip1 1") << "a name, not a chip";
  EXPECT_EQ(chosen("pinctrl-rp1:2"), "/dev/gpiochip0 2");
  EXPECT_EQ(chosen("gpiochip2:0"), "/dev/gpiochip2 0");
  EXPECT_EQ(chosen("gpiochip0:1"), "/dev/gpiochip3 1") << "a label goes before a name";
}

TEST(GpioLine, SaysWhatIsWrongWithItsName) {
  EXPECT_EQ(chosen("twice"), "GPIO line twice: 2 lines have this name; expected one of gpiochip1:2, gpiochip2:0");
  EXPECT_EQ(chosen("adapter:0"),
            "GPIO line adapter:0: 2 lines have this name; expected one of gpiochip1:0, gpiochip2:0");
  EXPECT_EQ(chosen("pinctrl-rp1:3"),
            "GPIO line pinctrl-rp1:3: the chip has 3 lines; expected an offset less than that");
  const std::string list =
      "one of ID_SDA, GPIO4, strobe, a:1, twice, twice; or CHIP:OFFSET with one of the chips pinctrl-rp1 (gpiochip0, 0 "
      "to 2), adapter (gpiochip1, 0 to 2), adapter (gpiochip2, 0 to 0), gpiochip0 (gpiochip3, 0 to 1)";
  for (const char* wanted : {"GPIO5", "", ":", "adapter:", "adapter:x", "adapter:-1", "adapter:1 ", "nobody:0"})
    EXPECT_EQ(chosen(wanted), std::string("GPIO line ") + wanted + ": no line has this name; expected " + list);
}

TEST(GpioLine, AFailedOpenLeavesItClosed) {
  GpioLine line("no such line", Edge::kRising);
  const Status status = line.open();
  ASSERT_FALSE(status);
  EXPECT_FALSE(line.is_open());
  EXPECT_NE(status.error().text(), "");
}

}  // namespace
}  // namespace epiline
