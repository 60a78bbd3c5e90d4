// The made-up flight, the judgement of its odometry, and what `epiline bench` prints of a computer.
#include "drivers/program/bench/bench.h"

#include <gmock/gmock.h>

#include <cmath>

#include "drivers/program/bench/made_up_flight.h"
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

using testing::HasSubstr;

/// Poses `scale` times as far from the first one as the made-up flight's.
FlightRecord flown(double scale) {
  const MadeUpFlight flight(10);
  FlightRecord record;
  record.images_read = flight.images();
  record.truth.emplace();
  for (std::size_t k = 0; k < flight.images(); ++k) {
    ImageRecord image;
    image.pose = flight.pose_at_image(k);
    image.stamp = image.pose.stamp;
    image.has_pose = k >= 10;
    add_pose(image.pose, *record.truth);
    image.pose.p_WB *= scale;
    record.images.push_back(image);
  }
  return record;
}

TEST(Bench, RightOdometryPasses) {
  const auto error = position_error(flown(1.01));
  ASSERT_TRUE(error) << error.error().text();
  EXPECT_GT(*error, 0.005);
}

TEST(Bench, WrongOdometryIsAFailedRun) {
  FlightRecord late = flown(1), gap = flown(1), refused = flown(1), none = flown(1);
  for (std::size_t k = 0; k < 45; ++k) late.images[k].has_pose = false;
  gap.images[100].has_pose = false;
  refused.images.pop_back();
  for (ImageRecord& image : none.images) image.has_pose = false;
  const auto expect_wrong = [](const FlightRecord& record, const char* part) {
    const auto error = position_error(record);
    ASSERT_FALSE(error) << part;
    EXPECT_EQ(error.error().kind, ErrorKind::kRun);
    EXPECT_THAT(error.error().text(), HasSubstr("the odometry is wrong: "));
    EXPECT_THAT(error.error().text(), HasSubstr(part));
  };
  expect_wrong(flown(1.3), "its error is 0.");
  expect_wrong(flown(std::nan("")), "");
  expect_wrong(late, "it started 2.2 s after the first image");
  expect_wrong(gap, "images after the start have no pose");
  expect_wrong(refused, "images after the start have no pose");
  expect_wrong(none, "it did not start");
}

TEST(Bench, TheSameImagesEachTime) {
  const MadeUpFlight flight(5), again(5);
  std::vector<std::uint8_t> image(752 * 480), same(image.size()), other(image.size());
  flight.draw_image(3, image.data());
  again.draw_image(3, same.data());
  flight.draw_image(4, other.data());
  EXPECT_EQ(image, same);
  EXPECT_NE(image, other);
}

/// Files as the kernel of a board shows them.
class BoardFiles : public testing::Test {
 protected:
  void SetUp() override { fs::remove_all(scratch()); }
  void TearDown() override { fs::remove_all(scratch()); }
};

TEST_F(BoardFiles, ARaspberryPiHasItsNameAndItsFlags) {
  write(scratch() / "proc/device-tree/model", std::string("Raspberry Pi 4 Model B Rev 1.4") + '\0');
  write(scratch() / "proc/cpuinfo", "processor\t: 0\nCPU part\t: 0xd08\nprocessor\t: 1\nCPU part\t: 0xd08\n");
  write(scratch() / "sys/class/thermal/thermal_zone0/temp", "48312\n");
  write(scratch() / "sys/class/thermal/thermal_zone1/temp", "61000\n");
  write(scratch() / "sys/devices/platform/soc/soc:firmware/get_throttled", "50005\n");
  for (const fs::path cpu = scratch() / "sys/devices/system/cpu";
       const auto& entry : fs::directory_iterator("/sys/devices/system/cpu")) {
    const fs::path clock = cpu / entry.path().filename() / "cpufreq";
    write(clock / "scaling_cur_freq", "600000\n");
    write(clock / "cpuinfo_max_freq", "1800000\n");
  }
  EXPECT_EQ(board_name(scratch()), "Raspberry Pi 4 Model B Rev 1.4, Cortex-A72");
  const BoardState state = board_state(scratch());
  EXPECT_EQ(state.hottest_c, 61);
  EXPECT_EQ(state.clock_mhz, 600);
  EXPECT_EQ(state.full_clock_mhz, 1800);
  EXPECT_EQ(throttling_text(state.throttled), "under-voltage now, throttled now");
}

TEST_F(BoardFiles, WhatTheKernelDoesNotSayIsLeftOpen) {
  write(scratch() / "proc/cpuinfo", "model name\t: AMD EPYC\nmodel name\t: AMD EPYC\n");
  EXPECT_EQ(board_name(scratch()), "AMD EPYC");
  const BoardState state = board_state(scratch());
  EXPECT_FALSE(state.hottest_c || state.clock_mhz || state.full_clock_mhz || state.throttled);
  EXPECT_EQ(throttling_text({}), "not known");
  EXPECT_EQ(throttling_text(0), "none");
  EXPECT_EQ(throttling_text(0x10000), "under-voltage earlier");
}

// The samples fit the images, or the odometry would be wrong.
TEST(BenchCommand, PrintsFiguresAndARowForTheTable) {
  const Outcome r = run("bench --duration 5");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  for (const char* name : {"computer ", "flight ", "track ", "solve ", "image ", "rate ", "memory ", "temperature ",
                           "clock ", "throttling ", "odometry    right: "})
    EXPECT_THAT(r.out, HasSubstr(name));
  const std::string row = r.out.substr(r.out.rfind("\n\n") + 2),
                    page = read(fs::path(EPILINE_SOURCE) / "docs/boards.md");
  const std::string head = page.substr(page.find("| board "));
  EXPECT_EQ(std::count(row.begin(), row.end(), '|'), std::count(head.begin(), head.begin() + head.find('\n'), '|'))
      << row;
  EXPECT_EQ(std::count(row.begin(), row.end(), '\n'), 1);
  expect_one_line(run("bench --duration 1"), 2, {"--duration"});
}

}  // namespace
}  // namespace epiline
