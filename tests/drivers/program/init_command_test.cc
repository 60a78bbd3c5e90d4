// `epiline init` as a user meets it, on whatever computer this is. What it chooses: inventory/draft_test.cc.
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

class InitCommand : public CommandTest {
 protected:
  static fs::path file() { return scratch() / "flight.toml"; }
  /// A computer without any device has nothing to write.
  static bool has_nothing(const Outcome& r) {
    if (r.err.find("is plugged in") == std::string::npos) return false;
    expect_one_line(r, 1, {"neither a camera nor anything with an IMU is plugged in"});
    EXPECT_FALSE(fs::exists(file()));
    return true;
  }
};

TEST_F(InitCommand, WritesAConfigurationAndSaysWhatIsNext) {
  const Outcome r = run("init --out " + in_quotes(file()));
  if (has_nothing(r)) return;
  EXPECT_EQ(r.exit_code, 0) << r.err;
  for (const char* next : {"epiline record --config ", "epiline calibrate ", "epiline check --config "})
    EXPECT_NE(r.out.find(next), std::string::npos) << r.out;
  EXPECT_EQ(run("config --check " + in_quotes(file())).exit_code, 0);
}

}  // namespace
}  // namespace epiline
