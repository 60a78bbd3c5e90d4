// Lists as people write them: each is read as if it were written as EuRoC's are, or refused with the cause.
#include "drivers/flights/recordings/asl_dataset.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "drivers/flights/recordings/image_file.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kStart_ns = 1'403'636'584'763'555'000;
constexpr int kImages = 20, kReadings = 240;

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

std::string seconds(std::int64_t ns) { return fmt::format("{}.{:09}", ns / 1'000'000'000, ns % 1'000'000'000); }
std::string nanoseconds(std::int64_t ns) { return std::to_string(ns); }

/// How a list is written.
struct Slip {
  const char* name;
  std::string image_head = "#timestamp [ns],filename\n", imu_head = "#timestamp [ns],w,w,w,a,a,a\n";
  std::function<std::string(std::int64_t)> image_time = nanoseconds, imu_time = nanoseconds;
  std::string comma = ",", before_name = "", ending = ".pgm", after_name = "";
  bool reversed = false;
  std::string note = "";         ///< part of what the user reads
  std::int64_t rounding_ns = 0;  ///< of the times
  friend void PrintTo(const Slip& slip, std::ostream* out) { *out << slip.name; }
};

class AslFolder : public testing::TestWithParam<Slip> {
 protected:
  AslFolder() : folder_(fs::path(testing::TempDir()) / ("epiline_asl_dataset_" + std::to_string(getpid()))) {
    write(mav() / "cam0/sensor.yaml",
          "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [64, 48]\ncamera_model: pinhole\n"
          "intrinsics: [40, 40, 32, 24]\ndistortion_model: none\n");
    for (int i = 0; i < kImages; ++i)
      write(mav() / "cam0/data" / (nanoseconds(image_ns(i)) + ".pgm"),
            "P5\n64 48\n255\n" + std::string(std::size_t{64} * 48, static_cast<char>(i)));
  }
  ~AslFolder() override { fs::remove_all(folder_); }

  void write_lists(const Slip& s) const {
    std::vector<std::string> images, imu;
    for (int i = 0; i < kImages; ++i)
      images.push_back(s.image_time(image_ns(i)) + s.comma + s.before_name + nanoseconds(image_ns(i)) + s.ending +
                       s.after_name + "\n");
    for (int i = 0; i < kReadings; ++i)
      imu.push_back(fmt::format("{1}{0}0.1{0}0.2{0}{2}{0}0.01{0}0.02{0}9.81\n", s.comma, s.imu_time(imu_ns(i)), i));
    for (auto* list : {&images, &imu})
      if (s.reversed) std::reverse(list->begin(), list->end());
    write(mav() / "cam0/data.csv", fmt::format("{}{}", s.image_head, fmt::join(images, "")));
    write(mav() / "imu0/data.csv", fmt::format("{}{}", s.imu_head, fmt::join(imu, "")));
  }

  fs::path mav() const { return folder_ / "mav0"; }
  static std::int64_t image_ns(int i) { return kStart_ns + i * 50'000'000LL; }
  static std::int64_t imu_ns(int i) { return kStart_ns + (i - 20) * 5'000'000LL; }
  fs::path folder_;
};

TEST_P(AslFolder, IsReadAsItIsMeant) {
  const Slip& slip = GetParam();
  write_lists(slip);
  const auto dataset = open_asl_dataset(folder_, "cam0");
  ASSERT_TRUE(dataset) << dataset.error().text();
  ASSERT_EQ(dataset->images.size(), static_cast<std::size_t>(kImages));
  ASSERT_EQ(dataset->imu_samples.size(), static_cast<std::size_t>(kReadings));
  for (int i = 0; i < kReadings; ++i) {
    const ImuSample& sample = dataset->imu_samples[static_cast<std::size_t>(i)];
    EXPECT_LE(std::abs(sample.stamp.ns - imu_ns(i)), slip.rounding_ns);
    EXPECT_EQ(sample.angular_velocity_rad_s[2], i);
  }
  ImageDecoder decoder;
  for (int i = 0; i < kImages; ++i) {
    const auto frame = decoder.read(static_cast<std::size_t>(i), *dataset);
    ASSERT_TRUE(frame) << frame.error().text();
    EXPECT_LE(std::abs(frame->stamp.ns - image_ns(i)), slip.rounding_ns);
    ASSERT_NE(frame->data, nullptr) << decoder.unreadable().kinds().begin()->second.first.text();
    EXPECT_EQ(frame->data[0], i);
  }
  const std::string notes = fmt::format("{}", fmt::join(dataset->notes, "\n"));
  EXPECT_NE(notes.find(slip.note), std::string::npos) << notes;
}

std::string microseconds(std::int64_t ns) { return std::to_string(ns / 1000); }
std::string milliseconds(std::int64_t ns) { return std::to_string(ns / 1'000'000); }

const Slip kSlips[] = {
    {.name = "Plain"},
    {.name = "Microseconds",
     .image_time = microseconds,
     .imu_time = microseconds,
     .note = "imu0/data.csv: the times are read as microseconds"},
    {.name = "Milliseconds",
     .image_time = milliseconds,
     .imu_time = milliseconds,
     .note = "cam0/data.csv: the times are read as milliseconds",
     .rounding_ns = 999'999},
    {.name = "ImagesInMicroseconds",
     .image_time = microseconds,
     .note = "cam0/data.csv: the times are read as microseconds"},
    {.name = "Seconds", .image_time = seconds, .imu_time = seconds, .note = "read as seconds"},
    {.name = "Exponents",
     .imu_time = [](std::int64_t ns) { return fmt::format("{:.18e}", static_cast<double>(ns)); },
     .rounding_ns = 256},
    {.name = "HeaderWithoutHash",
     .image_head = "timestamp [ns],filename\n",
     .imu_head = "timestamp,w_x [rad s^-1],b,c,d,e,f\n"},
    {.name = "Semicolons", .comma = ";"},
    {.name = "Exposure", .after_name = ",4000"},
    {.name = "NoEnding", .ending = ""},
    {.name = "Nested", .before_name = "data/"},
    {.name = "Reversed", .reversed = true, .note = "19 of 20 lines are not in the order of time: sorted"},
};
INSTANTIATE_TEST_SUITE_P(All, AslFolder, testing::ValuesIn(kSlips), [](const auto& slip) { return slip.param.name; });

class WrongAslFolder : public AslFolder {
 protected:
  std::string error() const {
    const auto dataset = open_asl_dataset(folder_, "cam0");
    return dataset ? "read" : dataset.error().text();
  }
};

TEST_F(WrongAslFolder, TwoClocksAreNamed) {
  write_lists({.name = "", .imu_time = [](std::int64_t ns) { return std::to_string(ns - kStart_ns + 1'000'000'000); }});
  EXPECT_NE(error().find("cam0/data.csv: images from 1403636584.764 to 1403636585.714 s, but IMU samples from 0.900 to "
                         "2.095 s; expected times of one clock"),
            std::string::npos)
      << error();
}

TEST_F(WrongAslFolder, ExchangedColumnsAreNamed) {
  write_lists({.name = ""});
  std::string imu;
  for (int i = 0; i < kReadings; ++i) imu += std::to_string(imu_ns(i)) + ",0.01,0.02,9.81,0.1,0.2,0.3\n";
  write(mav() / "imu0/data.csv", imu);
  EXPECT_NE(
      error().find("columns 2 to 4 have the length 9.81, as accelerations have, and columns 5 to 7 0.37; expected "
                   "time, 3 rates (rad/s), 3 accelerations (m/s^2), in this order"),
      std::string::npos)
      << error();
}

TEST_F(WrongAslFolder, LayoutsOfOthersAreNamed) {
  fs::create_directories(folder_ / "x");
  const auto is_refused_with = [&](const std::string& cause) {
    const auto dataset = open_asl_dataset(folder_ / "x", "cam0");
    return !dataset && dataset.error().text().find("/x: " + cause) != std::string::npos;
  };
  EXPECT_TRUE(is_refused_with("no mav0/imu0 or imu0 inside; expected a data set"));
  fs::create_directories(folder_ / "x/oxts/data");
  EXPECT_TRUE(is_refused_with("is a KITTI raw recording"));
  fs::create_directories(folder_ / "x/image_0");
  EXPECT_TRUE(is_refused_with("is a sequence of KITTI odometry: there is no IMU; expected"));
  write(folder_ / "x/rgb.txt", "# color images\n1305031102.175304 rgb/1305031102.175304.png\n");
  EXPECT_TRUE(is_refused_with("is a TUM RGB-D recording: there is no gyroscope; expected a data set"));
}

}  // namespace
}  // namespace epiline
