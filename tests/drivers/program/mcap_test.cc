// `replay --mcap`: what is written follows the specification of MCAP (https://mcap.dev/spec), and flies again to the
// same trajectory. tests/package/read_mcap.mjs has Foxglove's own readers read it.
#include <zlib.h>

#include <algorithm>
#include <map>

#include "drivers/flights/recordings/bag.h"
#include "drivers/flights/recordings/bag_dataset.h"
#include "drivers/flights/recordings/byte_reader.h"
#include "drivers/flights/recordings/mcap_output.h"
#include "drivers/flights/recordings/ros_message.h"
#include "pipeline/text/table.h"
#include "pipeline/text/trajectory.h"
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

class Mcap : public OverARenderedFlight {
 protected:
  void SetUp() override {
    OverARenderedFlight::SetUp();
    write(config, calibrated_by(flight_));
  }
  Outcome write_mcap(const std::string& more = "") {
    return replay("folder", "--mcap " + in_quotes(file) + " " + more);
  }
  Outcome replay_mcap() {
    return run("replay " + in_quotes(file) + " --config " + in_quotes(config) + " --out " +
               in_quotes(scratch() / "again"));
  }

  fs::path file = scratch() / "files/flight.mcap", config = scratch() / "config.toml";
};

TEST_F(Mcap, FliesAgainToTheSameTrajectory) {
  ASSERT_EQ(replay("plain", "").exit_code, 0);
  const Outcome r = write_mcap();
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const std::string wanted = read(scratch() / "plain/trajectory.tum");
  EXPECT_GT(std::count(wanted.begin(), wanted.end(), '\n'), 30);
  EXPECT_EQ(read(scratch() / "folder/trajectory.tum"), wanted) << "being watched changes nothing";
  const Outcome again = replay_mcap();
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(read(scratch() / "again/trajectory.tum"), wanted);
  EXPECT_EQ(stats("again")["error"]["ate_4dof_m"], stats("folder")["error"]["ate_4dof_m"]);
  EXPECT_EQ(stats("again")["imu"], stats("folder")["imu"]);
}

// The file holds the readings as they came: the calibration that corrects the folder's corrects the file's as well.
TEST_F(Mcap, ReadingsAreCorrectedOnceWhenTheyFlyAgain) {
  const fs::path imu = scratch() / "imu.yaml";
  write(imu, read(flight_ / "mav0/imu0/sensor.yaml") +
                 "accelerometers:\n  M: [1.02, 0, 0, 0.004, 0.98, 0, -0.003, 0.005, 1.01]\n"
                 "gyroscopes:\n  M: [0.98, 0, 0, 0.002, 1.01, 0, 0.001, 0, 1.02]\n"
                 "  A: [1.0e-4, 0, 0, 0, 2.0e-4, 0, 0, 0, 1.0e-4]\n");
  write(config, calibrated_by(flight_, imu));
  ASSERT_EQ(replay("uncorrected", "").exit_code, 0);
  const Outcome r = write_mcap("--config " + in_quotes(config));
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const std::string wanted = read(scratch() / "folder/trajectory.tum");
  EXPECT_GT(std::count(wanted.begin(), wanted.end(), '\n'), 30);
  EXPECT_NE(wanted, read(scratch() / "uncorrected/trajectory.tum"));
  ASSERT_EQ(replay_mcap().exit_code, 0);
  EXPECT_EQ(read(scratch() / "again/trajectory.tum"), wanted);
}

// A record of the flight recorder becomes a file as any folder does; the file also holds what was estimated in flight.
TEST_F(Mcap, OfAFlightRecordHoldsWhatWasFlown) {
  const fs::path records = scratch() / "records", record = records / "record-001-end";
  ASSERT_EQ(replay("run", "--realtime --speed 2 --record '" + records.string() + "' --record-images").exit_code, 0);
  const std::string of_record = "replay '" + record.string() + "' --config '" + (record / "config.toml").string() + "'";
  const auto replay_record = [&] {
    return run(of_record + " --mcap '" + file.string() + "' --out '" + (scratch() / "folder").string() + "'");
  };
  const Outcome r = replay_record();
  ASSERT_EQ(r.exit_code, 0) << r.err;
  write(config, calibrated_by(record));
  const Outcome again = replay_mcap();
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(read(scratch() / "again/trajectory.tum"), read(scratch() / "folder/trajectory.tum"));

  const auto recorded = read_trajectory(record / "trajectory.tum");
  const auto flown = open_bag_dataset(file, {"", "", "/epiline/flown/pose"}, "cam0", record / "mav0/cam0/sensor.yaml",
                                      record / "mav0/imu0/sensor.yaml");
  ASSERT_TRUE(recorded && flown && flown->ground_truth);
  const std::vector<TimedPose>&is = flown->ground_truth->poses, &was = recorded->poses;
  ASSERT_GT(was.size(), 60u);
  ASSERT_EQ(is.size(), was.size());
  for (std::size_t i = 0; i < was.size(); ++i) {
    EXPECT_EQ(is[i].stamp, was[i].stamp);
    EXPECT_EQ(is[i].p_WB, was[i].p_WB);
    EXPECT_LT(is[i].q_WB.angularDistance(was[i].q_WB), 1e-9);
  }
  EXPECT_FALSE(stats("again")["dataset"]["has_ground_truth"]);

  write(record / "trajectory.tum", "1 2 3\n");
  expect_one_line(replay_record(), 2, {"trajectory.tum:1", "expected"});
  write(record / "trajectory.tum", "");  // lost from the first image to the last
  EXPECT_EQ(replay_record().exit_code, 0);
}

TEST_F(Mcap, HoldsTheNumbersOfTheFlight) {
  ASSERT_EQ(write_mcap("--duration 2").exit_code, 0);
  const auto bag = epiline::Bag::open(file);
  ASSERT_TRUE(bag);
  std::map<std::string, std::vector<std::vector<std::uint8_t>>> messages;
  ASSERT_TRUE((*bag)->scan([&](const BagMessage& m) {
    messages[(*bag)->topics()[m.topic].name].emplace_back(m.bytes.begin(), m.bytes.end());
  }));
  const auto tum = parse_table(read(scratch() / "folder/trajectory.tum"), "", TimeColumn::kSeconds, {8}, "");
  ASSERT_TRUE(tum);
  const auto& odometry = messages["/epiline/odometry"];
  ASSERT_EQ(odometry.size(), tum->rows());
  EXPECT_EQ(messages["/epiline/pose"].size(), tum->rows());
  EXPECT_EQ(messages["/tf"].size(), tum->rows());
  EXPECT_EQ(messages["/cam0/image_raw/compressed"].size(), messages["/cam0/tracks"].size());
  EXPECT_EQ(messages["/diagnostics"].size(), messages["/cam0/tracks"].size());
  for (std::size_t i = 0; i < tum->rows(); ++i) {
    const auto pose = parse_pose("nav_msgs/Odometry", {RosEncoding::kCdr, odometry[i]});
    ASSERT_TRUE(pose);
    EXPECT_EQ(pose->stamp.ns, tum->time_ns[i]);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(pose->p_WB[k], tum->row(i)[k], 1e-9);
    for (int k = 0; k < 4; ++k) EXPECT_NEAR(pose->q_WB.coeffs()[k], tum->row(i)[3 + k], 1e-9);
  }
}

std::uint32_t sum_of(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(crc32_z(0, bytes.data(), bytes.size()));
}

/// A record of a file: its opcode and what is in it.
struct McapRecord {
  std::uint8_t op = 0;
  std::span<const std::uint8_t> content;
  std::size_t size = 0;
};
McapRecord record_at(std::span<const std::uint8_t> file, std::size_t at) {
  ByteReader in(file.subspan(at));
  McapRecord record;
  record.op = in.number<std::uint8_t>();
  record.content = in.block<std::uint64_t>();
  record.size = in.at();
  EXPECT_TRUE(in.good()) << at;
  return record;
}

TEST(McapOutputTest, SummaryLeadsToEveryMessage) {
  const fs::path path = scratch() / "a.mcap";
  fs::create_directories(path.parent_path());
  McapOutput writer(path);
  const std::uint16_t a = writer.add_channel("/a", "x_msgs/msg/X", "byte x\n"),
                      b = writer.add_channel("/b", "x_msgs/msg/X", "byte x\n");
  constexpr std::size_t kMessages = 40;
  for (std::size_t i = 0; i < kMessages; ++i)
    writer.write(i % 3 == 0 ? b : a, 1'000 + static_cast<std::int64_t>(i),
                 std::string(60'000, static_cast<char>('0' + i)));
  ASSERT_TRUE(writer.finish());
  const std::string text = read(path);
  const std::span<const std::uint8_t> file(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  const std::string magic = "\x89MCAP0\r\n";
  ASSERT_TRUE(text.starts_with(magic) && text.ends_with(magic));

  const std::size_t footer = file.size() - 8 - 20 - 9;
  ByteReader end(record_at(file, footer).content);
  const auto summary = end.number<std::uint64_t>(), offsets = end.number<std::uint64_t>();
  EXPECT_EQ(end.number<std::uint32_t>(), sum_of(file.subspan(summary, file.size() - 8 - 4 - summary)));
  const McapRecord data_end = record_at(file, summary - 13);
  EXPECT_EQ(data_end.op, 15);
  EXPECT_EQ(ByteReader(data_end.content).number<std::uint32_t>(), sum_of(file.first(summary - 13)));

  std::map<std::uint8_t, int> kinds;
  std::size_t messages = 0;
  for (std::size_t at = summary; at < offsets;) {
    const McapRecord record = record_at(file, at);
    at += record.size;
    ++kinds[record.op];
    if (record.op != 8) continue;
    ByteReader index(record.content);
    const auto first = index.number<std::uint64_t>(), last = index.number<std::uint64_t>(),
               start = index.number<std::uint64_t>(), size = index.number<std::uint64_t>();
    const McapRecord chunk = record_at(file, start);
    EXPECT_EQ(chunk.op, 6);
    EXPECT_EQ(chunk.size, size);
    ByteReader head(chunk.content);
    EXPECT_EQ(head.number<std::uint64_t>(), first);
    EXPECT_EQ(head.number<std::uint64_t>(), last);
    ByteReader places(index.block<std::uint32_t>());
    EXPECT_EQ(record_at(file, start + size).op, 7);
    while (places.left() > 0) {
      const auto channel = places.number<std::uint16_t>();
      const McapRecord of_channel = record_at(file, places.number<std::uint64_t>());
      EXPECT_EQ(of_channel.op, 7);
      ByteReader entries(of_channel.content);
      EXPECT_EQ(entries.number<std::uint16_t>(), channel);
      messages += entries.block<std::uint32_t>().size() / 16;
    }
  }
  EXPECT_EQ(messages, kMessages);
  EXPECT_EQ(kinds[3], 1);
  EXPECT_EQ(kinds[4], 2);
  EXPECT_EQ(kinds[11], 1);
  EXPECT_EQ(kinds[8], 3) << "chunks of a megabyte";
  fs::remove_all(scratch());
}

TEST_F(Mcap, AnEstimateIsNoGroundTruth) {
  const fs::path truth = flight_ / "mav0/state_groundtruth_estimate0", away = flight_ / "truth";
  fs::rename(truth, away);
  EXPECT_EQ(write_mcap().exit_code, 0);
  fs::rename(away, truth);
  ASSERT_EQ(replay_mcap().exit_code, 0);
  EXPECT_FALSE(stats("again")["dataset"]["has_ground_truth"]);
}

TEST_F(Mcap, ReplacesNothingThatIsNotItsOwn) {
  write(file, "mine");
  expect_one_line(write_mcap(), 2, {"flight.mcap", "no earlier result"});
  EXPECT_EQ(read(file), "mine");
  fs::remove(file);
  EXPECT_EQ(write_mcap("--duration 1").exit_code, 0);
  EXPECT_EQ(write_mcap("--duration 1").exit_code, 0);
  expect_one_line(run("replay '" + file.string() + "' --config '" + config.string() + "' --mcap '" + file.string() +
                      "' --out '" + (scratch() / "again").string() + "'"),
                  2, {"is the recording that is read"});
  EXPECT_EQ(write_mcap("--realtime").exit_code, 2);
  fs::create_directories(scratch() / "files/empty");
  file = scratch() / "files/empty";
  expect_one_line(write_mcap(), 2, {"files/empty: cannot be written"});
}

}  // namespace
}  // namespace epiline
