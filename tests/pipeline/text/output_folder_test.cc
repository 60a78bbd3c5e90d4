#include "pipeline/text/output_folder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "pipeline/text/table.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

class AnOutputFolder : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  /// What a command does: claim, write, end. False: refused.
  bool write(const std::string& text, Foreign foreign = Foreign::kRefuse) const {
    const auto claimed = OutputFolder::claim(folder_, {"result.txt", "parts"}, foreign);
    if (!claimed) return false;
    return write_text(folder_ / "result.txt", text) && make_folder(folder_ / "parts/a") &&
           write_text(folder_ / "parts/a/b.txt", text);
  }
  void put(const char* name, const std::string& text) const {
    ASSERT_TRUE(make_folder((folder_ / name).parent_path()));
    ASSERT_TRUE(write_text(folder_ / name, text));
  }
  std::string text(const char* name) const { return *read_text(folder_ / name); }
  fs::path folder_ = fs::path(testing::TempDir()) / ("epiline_output_folder_" + std::to_string(getpid()));
};

TEST_F(AnOutputFolder, IsWrittenAgainWithoutQuestion) {
  put("other.txt", "mine");
  EXPECT_TRUE(write("1"));
  EXPECT_TRUE(write("2"));
  EXPECT_EQ(text("result.txt"), "2");
  EXPECT_EQ(text("other.txt"), "mine");
}

TEST_F(AnOutputFolder, KeepsResultsThatWereEdited) {
  EXPECT_TRUE(write("1"));
  put("result.txt", "!");  // as long as before
  EXPECT_FALSE(write("2"));
  EXPECT_EQ(text("result.txt"), "!");
  EXPECT_TRUE(write("3", Foreign::kReplace));
  EXPECT_TRUE(write("4"));
}

TEST_F(AnOutputFolder, KeepsFilesThatCameInto) {
  EXPECT_TRUE(write("1"));
  put("parts/mine.txt", "mine");
  EXPECT_FALSE(write("2"));
  EXPECT_EQ(text("parts/a/b.txt"), "1");
}

TEST_F(AnOutputFolder, DoesNotAdoptWhatItDidNotReplaceInTheEnd) {
  put("result.txt", "mine");
  EXPECT_TRUE(OutputFolder::claim(folder_, {"result.txt"}, Foreign::kReplace));  // and the command fails
  EXPECT_FALSE(OutputFolder::claim(folder_, {"result.txt"}, Foreign::kRefuse));
}

TEST_F(AnOutputFolder, KeepsForeignFilesBesideWithANumber) {
  put("result.txt", "mine");
  EXPECT_TRUE(write("1", Foreign::kKeep));
  EXPECT_TRUE(write("2", Foreign::kKeep));  // its own: replaced
  EXPECT_EQ(text("result.txt"), "2");
  EXPECT_EQ(text("result.txt.1"), "mine");
  EXPECT_FALSE(fs::exists(folder_ / "result.txt.2"));
}

TEST_F(AnOutputFolder, RemembersTheResultsOfOtherCommands) {
  {
    const auto claimed = OutputFolder::claim(folder_, {"other.txt"}, Foreign::kRefuse);
    put("other.txt", "of another command");
  }
  EXPECT_TRUE(write("1"));
  EXPECT_TRUE(OutputFolder::claim(folder_, {"other.txt"}, Foreign::kRefuse));
}

TEST_F(AnOutputFolder, IsTriedWithoutATrace) {
  EXPECT_TRUE(OutputFolder::claim(folder_ / "a/b", {"x"}, Foreign::kRefuse));
  EXPECT_TRUE(fs::is_empty(folder_));
  put("file", "mine");
  EXPECT_FALSE(OutputFolder::claim(folder_ / "file", {"x"}, Foreign::kRefuse));
  EXPECT_FALSE(OutputFolder::claim(folder_ / "file/b", {"x"}, Foreign::kRefuse));
  EXPECT_EQ(text("file"), "mine");
}

}  // namespace
}  // namespace epiline
