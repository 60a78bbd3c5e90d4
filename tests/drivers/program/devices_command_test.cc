// `epiline devices` as a user meets it, on whatever computer this is.
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

TEST(DevicesCommand, ListsEveryKindWithoutAConfiguration) {
  const Outcome text = run("devices");
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_EQ(text.err, "");
  const Outcome json = run("devices --json");
  const Json all = Json::parse(json.out);
  EXPECT_EQ(all["schema"], 1);
  for (const char* kind : {"cameras", "imus", "spi", "serial", "can", "gpio"})
    EXPECT_TRUE(all[kind].is_array()) << kind;
  for (const char* kind : {"camera ", "imu ", "spi ", "serial ", "can ", "gpio "})
    EXPECT_NE(("\n" + text.out).find(std::string("\n") + kind), std::string::npos) << kind;
  fs::remove_all(scratch());
}

}  // namespace
}  // namespace epiline
