// The DBC file: the one in docs is that of the program, and identifiers follow the configuration.
#include <gtest/gtest.h>

#include "drivers/links/can/dbc.h"
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

TEST(Dbc, TheFileInTheDocumentsIsThatOfTheTable) {
  const Outcome printed = run("dbc");
  ASSERT_EQ(printed.exit_code, 0) << printed.err;
  EXPECT_EQ(printed.out, read(fs::path(EPILINE_SOURCE) / "docs/epiline.dbc"))
      << "the layout has changed: count kLayoutVersion on, and write the file anew with `epiline dbc`";
}

TEST(Dbc, IdentifiersAreThoseOfTheConfiguration) {
  const fs::path config = scratch() / "config.toml";
  write(config, "[can]\nbase_id = 0x123\n");
  const Outcome printed = run("dbc --config " + in_quotes(config));
  ASSERT_EQ(printed.exit_code, 0) << printed.err;
  EXPECT_EQ(printed.out, can::dbc_text(0x123));
  EXPECT_NE(printed.out.find("\nBO_ 291 EpilineStatus: 8 Epiline\n"), std::string::npos);
  write(config, "[can]\nbase_id = 0x7ff\n");
  expect_one_line(run("dbc --config " + in_quotes(config)), 2, {"base_id"});
}

}  // namespace
}  // namespace epiline
