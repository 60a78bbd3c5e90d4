#include "pipeline/text/table.h"

#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace epiline {
namespace {

namespace fs = std::filesystem;

fs::path scratch(const std::string& name) { return fs::path(testing::TempDir()) / ("epiline_table_" + name); }

void write(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

void write_gzipped(const fs::path& path, const std::string& text) {
  const gzFile file = gzopen(path.c_str(), "wb");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
}

TEST(ParseTime, KeepsEveryNanosecond) {
  std::int64_t ns = 0;
  ASSERT_TRUE(parse_time("1403636584.763555584", kInSeconds, ns));
  EXPECT_EQ(ns, 1403636584763555584);
  ASSERT_TRUE(parse_time("-0.000000001", kInSeconds, ns));
  EXPECT_EQ(ns, -1);
  ASSERT_TRUE(parse_time("-3.25", kInSeconds, ns));
  EXPECT_EQ(ns, -3'250'000'000);
  ASSERT_TRUE(parse_time("7", kInSeconds, ns));
  EXPECT_EQ(ns, 7'000'000'000);
  ASSERT_TRUE(parse_time("0.9999999996", kInSeconds, ns));
  EXPECT_EQ(ns, 1'000'000'000);
  ASSERT_TRUE(parse_time("1.5e3", kInSeconds, ns));
  EXPECT_EQ(ns, 1'500'000'000'000);
}

TEST(ParseTime, RefusesWhatIsNoTime) {
  std::int64_t ns = 0;
  for (const char* text : {"", "abc", "1.2.3", "nan", "inf", "1e30", "99999999999999999", "1.5x", "--3"}) {
    EXPECT_FALSE(parse_time(text, kInSeconds, ns)) << text;
  }
}

// 2^62 is too much: the difference of two times is a number of 64 bits.
TEST(ParseTime, RefusesWhatNoClockShows) {
  for (const auto column : {TimeColumn::kNanoseconds, TimeColumn::kSensor, TimeColumn::kImu}) {
    for (const std::string sign : {"", "-"}) {
      EXPECT_TRUE(parse_table(sign + "4611686018427387903,1\n", "f.csv", column, {2}, "row"));
      const auto table = parse_table("0,1\n" + sign + "4611686018427387904,1\n", "f.csv", column, {2}, "row");
      ASSERT_FALSE(table);
      EXPECT_TRUE(table.error().text().starts_with("f.csv:2: \"" + sign + "46116")) << table.error().text();
    }
  }
}

// The mean step of the middle half, whatever single times and bursts do.
TEST(TimeUnit, IsThatOfTheRate) {
  const auto unit = [](double step, TimeColumn column) {
    std::vector<double> times = {0, 1e25, std::nan("")};
    for (int i = 0; i < 200; ++i) times.push_back(1.4e18 + step * (i - i % 3));
    return std::string(unit_of(times, column).name);
  };
  EXPECT_EQ(unit(0.999e6, TimeColumn::kSensor), "nanoseconds") << "wheels, 1 kHz";
  EXPECT_EQ(unit(1e10, TimeColumn::kSensor), "nanoseconds") << "once in ten seconds";
  EXPECT_EQ(unit(125e3, TimeColumn::kImu), "nanoseconds") << "8 kHz";
  EXPECT_EQ(unit(40e6, TimeColumn::kImu), "nanoseconds") << "25 Hz";
  EXPECT_EQ(unit_of({}, TimeColumn::kImu).digits, 0);
  EXPECT_EQ(unit_of({5, 5}, TimeColumn::kSensor).digits, 0);
  EXPECT_EQ(unit_of({1000, 1005, 1010}, TimeColumn::kImu).digits, 6) << "200 Hz in milliseconds";
  EXPECT_EQ(unit_of({1.0, 1.05, 1.1}, TimeColumn::kSensor).digits, 9) << "20 Hz in seconds";
  EXPECT_EQ(unit_of({1e15, 1e15 + 5e4}, TimeColumn::kSensor).digits, 3) << "20 Hz in microseconds";
}

TEST(TakeField, SplitsAtCommasAndBlanks) {
  const auto split = [](std::string_view line) {
    std::vector<std::string> fields;
    for (std::string_view field; take_field(line, field);) fields.emplace_back(field);
    return fields;
  };
  using Fields = std::vector<std::string>;
  EXPECT_EQ(split("1,2, 3"), (Fields{"1", "2", "3"}));
  EXPECT_EQ(split("1 2\t 3 "), (Fields{"1", "2", "3"}));
  EXPECT_EQ(split("1,,3"), (Fields{"1", "", "3"}));
  EXPECT_EQ(split("1,2,"), (Fields{"1", "2", ""}));
}

TEST(ParseTable, ReadsNumbersCommentsAndForeignLineEnds) {
  const auto t = parse_table("\xEF\xBB\xBF#time,a,b\r\n10,1.5,-2e3\r\n\r\n  20 , nan,+inf \n", "f",
                             TimeColumn::kNanoseconds, {3}, "row");
  ASSERT_TRUE(t) << t.error().text();
  ASSERT_EQ(t->rows(), 2u);
  EXPECT_EQ(t->columns, 2u);
  EXPECT_EQ(t->time_ns[1], 20);
  EXPECT_DOUBLE_EQ(t->row(0)[0], 1.5);
  EXPECT_DOUBLE_EQ(t->row(0)[1], -2000);
  EXPECT_TRUE(std::isnan(t->row(1)[0]));
  EXPECT_TRUE(std::isinf(t->row(1)[1]));
}

struct BadText {
  const char *text, *complaint;
};

class BadTable : public testing::TestWithParam<BadText> {};

TEST_P(BadTable, NamesFileLineAndExpectation) {
  const auto t = parse_table(GetParam().text, "f.csv", TimeColumn::kNanoseconds, {3, 5}, "row");
  ASSERT_FALSE(t);
  EXPECT_EQ(t.error().text(), GetParam().complaint);
}

INSTANTIATE_TEST_SUITE_P(
    All, BadTable,
    testing::Values(BadText{"# head\n1,2,3\n4,5\n", "f.csv:3: 2 values; expected 3 in a line, one row"},
                    BadText{"1,2,3\n4,5,6,7,8\n", "f.csv:2: 5 values; expected 3 in a line, one row"},
                    BadText{"1\n", "f.csv:1: 1 value; expected 3 or 5 in a line, one row"},
                    BadText{"1,2,x\n", "f.csv:1: \"x\"; expected a number"},
                    BadText{"1,2,\n", "f.csv:1: \"\"; expected a number"},
                    BadText{"1,2,3.5.1\n", "f.csv:1: \"3.5.1\"; expected a number"},
                    BadText{"1.5,2,3\n", "f.csv:1: \"1.5\"; expected a time in integer nanoseconds"},
                    BadText{"99999999999999999999,2,3\n",
                            "f.csv:1: \"99999999999999999999\"; expected a time in integer nanoseconds"}));

TEST(ReadText, UnpacksGzipAndReadsPlain) {
  std::string text;
  for (int i = 0; i < 400'000; ++i) text += std::to_string(i) + "\n";  // more than one chunk
  write(scratch("plain"), text);
  write_gzipped(scratch("packed.gz"), text);
  const auto plain = read_text(scratch("plain")), packed = read_text(scratch("packed.gz"));
  ASSERT_TRUE(plain);
  ASSERT_TRUE(packed);
  EXPECT_EQ(*plain, text);
  EXPECT_EQ(*packed, text);
}

TEST(ReadText, RefusesACutOrDamagedGzipStream) {
  std::string noise;
  for (unsigned i = 0, x = 1; i < 100'000; ++i) noise += static_cast<char>((x = x * 1664525u + 1013904223u) >> 24);
  write_gzipped(scratch("whole.gz"), noise);
  std::string bytes = *read_text(scratch("whole.gz")) == noise ? "" : "unreadable";
  std::ifstream in(scratch("whole.gz"), std::ios::binary);
  bytes.assign(std::istreambuf_iterator<char>(in), {});
  write(scratch("cut.gz"), bytes.substr(0, bytes.size() / 2));
  EXPECT_FALSE(read_text(scratch("cut.gz")));
  bytes[bytes.size() / 2] = static_cast<char>(~bytes[bytes.size() / 2]);
  write(scratch("damaged.gz"), bytes);
  EXPECT_FALSE(read_text(scratch("damaged.gz")));
}

// The same text as iconv writes it, with a character of each length; the last one is cut.
TEST(ReadText, Utf16BecomesUtf8) {
  const std::string little(
      "\xff\xfe"
      "1\0,\0\xe9\0\xac\x20\x3c\xd8\x81\xdf\n\0",
      16),
      big("\xfe\xff"
          "\0"
          "1\0,\0\xe9\x20\xac\xd8\x3c\xdf\x81\0\n",
          16);
  for (const std::string& text : {little, big}) {
    write(scratch("utf16.csv"), text);
    EXPECT_EQ(*read_text(scratch("utf16.csv")), "1,\xc3\xa9\xe2\x82\xac\xf0\x9f\x8e\x81\n");
  }
  write(scratch("utf16.csv"), little.substr(0, 5));
  EXPECT_EQ(*read_text(scratch("utf16.csv")), "1\xef\xbf\xbd");
}

TEST(ReadText, NamesWhatIsNotThere) {
  const auto text = read_text("/nonexistent/file.csv");
  ASSERT_FALSE(text);
  EXPECT_EQ(text.error().text(),
            "/nonexistent/file.csv: cannot be opened (No such file or directory); expected a readable file");
  EXPECT_FALSE(read_text(testing::TempDir()));  // a folder
}

class WriteText : public testing::Test {
 protected:
  WriteText() { fs::create_directories(folder_); }
  ~WriteText() override { fs::remove_all(folder_); }
  const fs::path folder_ = fs::path(testing::TempDir()) / ("epiline_write_text_" + std::to_string(getpid()));
  const fs::path file_ = folder_ / "settings.toml";
};

// On a full disk, or with the power gone, the old file is still there, whole.
TEST_F(WriteText, TheOldFileStaysUntilTheNewOneIsWhole) {
  ASSERT_TRUE(write_text(file_, "old"));
  fs::create_directories(file_.string() + ".epiline-new");  // the new one cannot be made
  EXPECT_FALSE(write_text(file_, "new"));
  EXPECT_EQ(*read_text(file_), "old");
  fs::remove(file_.string() + ".epiline-new");
  std::ifstream reader(file_);  // who has the old one open reads it to its end
  ASSERT_TRUE(write_text(file_, "new"));
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(reader), {}), "old");
  EXPECT_EQ(*read_text(file_), "new");
  EXPECT_FALSE(fs::exists(file_.string() + ".epiline-new"));
}

TEST_F(WriteText, LinksAndPermissionsStay) {
  ASSERT_TRUE(write_text(file_, "old"));
  fs::permissions(file_, fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read);
  fs::create_symlink(file_, folder_ / "link");
  ASSERT_TRUE(write_text(folder_ / "link", "new"));
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(*read_text(file_), "new");
  EXPECT_EQ(fs::status(file_).permissions(), fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read);
}

TEST_F(WriteText, WhatIsNoFileIsWrittenTo) {
  EXPECT_TRUE(write_text("/dev/null", "text"));
  const Status full = write_text("/dev/full", "text");
  ASSERT_FALSE(full);
  EXPECT_NE(full.error().text().find("No space left"), std::string::npos);
}

}  // namespace
}  // namespace epiline
