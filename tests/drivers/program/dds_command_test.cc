// `--dds` as a node of ROS 2 meets it: another maker's DDS, with ROS 2's own types (dds/ros_peer.cc), reads the numbers
// of the trajectory.
#include <cmath>
#include <ctime>
#include <map>
#include <sstream>

#include "drivers/program/dds/dds_output.h"
#include "platform/time/monotonic.h"
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

class DdsCommand : public OverARenderedFlight {};

#ifndef EPILINE_CYCLONEDDS

TEST_F(DdsCommand, WithoutCycloneDdsItIsRefused) {
  expect_one_line(replay("out", "--realtime --dds"), 2, {"built without Cyclone DDS", "cyclonedds-dev"});
}

#endif

TEST_F(DdsCommand, SaysWhatIsWrong) {
  EXPECT_EQ(replay("out", "--dds").exit_code, 2) << "not without --realtime";
  for (const char* id : {"abc", "-1", "233", "1.5"})
    expect_one_line(run("replay '" + flight_.string() + "' --realtime --dds", std::string("ROS_DOMAIN_ID=") + id + " "),
                    2, {std::string("ROS_DOMAIN_ID=") + id, "0 to 232"});
}

#if defined(EPILINE_CYCLONEDDS) && defined(EPILINE_ROS_PEER)

struct Message {
  std::string time;
  std::vector<std::string> fields;  ///< behind the time; texts without quotes
  double number(std::size_t i) const { return std::stod(fields.at(i)); }
};

/// By topic.
std::map<std::string, std::vector<Message>> messages_of(const fs::path& file) {
  std::map<std::string, std::vector<Message>> messages;
  std::istringstream lines(read(file));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream in(line);
    std::string topic;
    Message message;
    in >> topic >> message.time;
    for (std::string field; in >> std::quoted(field);) message.fields.push_back(field);
    messages[topic].push_back(message);
  }
  return messages;
}

/// Lines of trajectory.tum by their time.
std::map<std::string, std::vector<double>> rows_of(const fs::path& tum) {
  std::map<std::string, std::vector<double>> rows;
  std::istringstream lines(read(tum));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream in(line);
    std::string time;
    in >> time;
    for (double value = 0; in >> value;) rows[time].push_back(value);
  }
  return rows;
}

/// Runs the script, in a network of its own where that is allowed: loopback alone.
int run_script(const std::string& script) {
  const fs::path file = scratch() / "script";
  write(file, script);
  const std::string alone =
      "unshare -rn sh -c 'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec sh \"$0\"' ";
  const std::string has_alone = "command -v ip >/dev/null && unshare -rn true 2>/dev/null";
  return std::system(("cd '" + scratch().string() + "' && if " + has_alone + "; then " + alone + "'" + file.string() +
                      "'; else sh '" + file.string() + "'; fi")
                         .c_str());
}

void expect_poses(const std::vector<Message>& messages, std::size_t first_number,
                  const std::map<std::string, std::vector<double>>& rows) {
  constexpr double kLastDigit = 0.6e-9;  // of a number in the file
  for (const Message& m : messages) {
    ASSERT_EQ(rows.count(m.time), 1U) << m.time;
    for (std::size_t i = 0; i < 7; ++i)
      EXPECT_NEAR(m.number(first_number + i), rows.at(m.time)[i], kLastDigit) << m.time << ", number " << i;
  }
}

// Five readers of one flight: reliable, best effort, in another domain, late, and killed on the way.
TEST_F(DdsCommand, AStrangerReadsTheTrajectoryAndTheFlightDoesNotCare) {
  const int domain = 10 + static_cast<int>(getpid()) % 80;
  const std::string peer = std::string("'") + EPILINE_ROS_PEER + "' ", in = std::to_string(domain);
  write(scratch() / "patient.toml", kPatient);
  const int status = run_script(
      peer + in + " 60 >all & all=$!\n" + peer + in + " 60 best-effort >newest & newest=$!\n" + peer +
      std::to_string(domain + 1) + " 60 >elsewhere & elsewhere=$!\n" + peer + in + " 60 >killed & killed=$!\n" +
      "for i in $(seq 100); do [ $(cat all newest elsewhere killed | grep -c listening) = 4 ] && break; sleep 0.1; "
      "done\n" +
      "(sleep 3; kill -9 $killed; exec " + peer + in + " 60 >late) & late=$!\nROS_DOMAIN_ID=" + in + " '" +
      EPILINE_PROGRAM + "' replay '" + flight_.string() +
      "' --realtime --dds --config patient.toml --out out >stdout 2>stderr; code=$?\n" +
      "n=-1; until [ $n = $(cat all newest late | wc -c) ]; do\nn=$(cat all newest late | wc -c); sleep 0.3; done\n" +
      "kill $all $newest $elsewhere $late; exit $code\n");
  ASSERT_EQ(WEXITSTATUS(status), 0) << read(scratch() / "stderr");

  const auto rows = rows_of(scratch() / "out/trajectory.tum");
  auto all = messages_of(scratch() / "all");
  ASSERT_GT(rows.size(), 60U);
  const auto& odometry = all["rt/odometry"];
  ASSERT_GT(odometry.size(), 50U) << "the first ones may go before the reader is found";
  EXPECT_EQ(all["rt/tf"].size(), odometry.size());
  EXPECT_EQ(static_cast<std::size_t>(std::distance(rows.find(odometry.front().time), rows.end())), odometry.size())
      << "none is missing from then on";
  expect_poses(odometry, 2, rows);
  expect_poses(all["rt/tf"], 2, rows);
  for (const Message& m : odometry) {
    ASSERT_EQ(m.fields.size(), 2U + 7 + 36 + 6 + 36) << "and nothing behind them";
    EXPECT_EQ(m.fields[0] + " " + m.fields[1], "odom base_link");
  }
  EXPECT_EQ(all["rt/tf"].front().fields.size(), 2U + 7);

  // once a second, and with each change of health; the speed is that of the odometry of this time
  const auto& diagnostics = all["rt/diagnostics"];
  EXPECT_GE(diagnostics.size(), 3U);
  EXPECT_LT(diagnostics.size(), 30U);
  const Message& last = diagnostics.back();
  EXPECT_EQ(last.fields.at(2), "epiline: odometry");
  EXPECT_EQ(last.fields.at(3), "tracking");
  const auto speed = std::find(last.fields.begin(), last.fields.end(), "speed_m_s");
  const auto then = std::find_if(odometry.begin(), odometry.end(), [&](auto& m) { return m.time == last.time; });
  ASSERT_TRUE(speed != last.fields.end() && then != odometry.end());
  EXPECT_NEAR(std::stod(speed[1]), std::hypot(then->number(45), then->number(46), then->number(47)), 1e-4);

  // the hash is what Iron and later compare
  EXPECT_EQ(all["found"].size(), 3U);
  EXPECT_NE(read(scratch() / "all").find("found rt/odometry nav_msgs::msg::dds_::Odometry_ typehash=RIHS01_"),
            std::string::npos);

  const auto late = messages_of(scratch() / "late")["rt/odometry"];
  ASSERT_GT(late.size(), 10U);
  EXPECT_LT(late.size(), rows.size() - 20) << "what was before it came is over";
  EXPECT_EQ(late.back().time, rows.rbegin()->first);
  expect_poses(late, 2, rows);
  const auto newest = messages_of(scratch() / "newest")["rt/odometry"];
  EXPECT_GT(newest.size(), 40U);
  expect_poses(newest, 2, rows);
  EXPECT_EQ(read(scratch() / "elsewhere"), "listening\n");
  EXPECT_GT(messages_of(scratch() / "killed")["rt/odometry"].size(), 5U);

  EXPECT_NE(read(scratch() / "stdout").find("dds       " + std::to_string(rows.size()) + " images sent, 0 not sent\n"),
            std::string::npos);
#ifndef EPILINE_SANITIZED
  const Json figures = stats("out");
  EXPECT_EQ(figures["realtime"]["threads"].size(), 6U);
  for (const auto& [name, thread] : figures["realtime"]["threads"].items()) {
    EXPECT_EQ(thread["heap_allocations"], 0) << name;
    EXPECT_EQ(thread["lock_calls"], 0) << name;
  }
#endif
}

#else

TEST_F(DdsCommand, AStrangerReadsTheTrajectoryAndTheFlightDoesNotCare) {
  GTEST_SKIP() << "built without Cyclone DDS (cyclonedds-dev) or without Fast DDS, the reader (libfastrtps-dev)";
}

#endif

TEST(DdsOutputTest, TimesOfALiveFlightAreOfTheSystemClock) {
  const auto system_ns = [] {
    timespec t{};
    clock_gettime(CLOCK_REALTIME, &t);
    return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
  };
  constexpr std::int64_t kMilliseconds = 1'000'000;
  const std::int64_t before = system_ns();
  const HostStamp now{monotonic_ns()};
  const std::int64_t after = system_ns();
  const HostStamp time = on_system_clock(now);
  EXPECT_GT(time.ns, before - 1 * kMilliseconds);
  EXPECT_LT(time.ns, after + 1 * kMilliseconds);
}

TEST(DdsOutputTest, WithoutADomainItTakesNothingAndEnds) {
  DdsOutput output(DdsOutput::Times::kOfDay);
  FrameOutcome outcome;
  outcome.result.has_pose = true;
  for (int i = 0; i < 1000; ++i) output.take(outcome);
  EXPECT_TRUE(output.publish(outcome.odometry));
  output.close();
  EXPECT_EQ(output.sent() + output.not_sent(), 0U);
}

}  // namespace
}  // namespace epiline
