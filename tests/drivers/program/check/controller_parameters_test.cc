// `epiline check` at a line whose controller has wrong parameters: it names each, with the value that does.
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>

#include "tests/drivers/links/mavlink/asked_controller.h"
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

using mavlink::AskedController;

struct Wrong {
  std::uint8_t autopilot;
  std::array<unsigned, 3> version;
  std::string name;
  double value;
  std::string remedy;
};

const Wrong kWrong[] = {
    {AskedController::kIsPx4, {1, 17, 0}, "EKF2_EN", 0, "set EKF2_EN to 1"},
    {AskedController::kIsPx4, {1, 17, 0}, "EKF2_EV_CTRL", 7, "set EKF2_EV_CTRL to 15"},
    {AskedController::kIsPx4, {1, 17, 0}, "EKF2_EVA_NOISE", 0.1, "set EKF2_EVA_NOISE to 0.05"},
    {AskedController::kIsPx4, {1, 16, 0}, "EKF2_EV_NOISE_MD", 1, "set EKF2_EV_NOISE_MD to 0"},
    {AskedController::kIsPx4, {1, 18, 0}, "EKF2_SENS_EN", 8183, "add 8 to EKF2_SENS_EN"},
    {AskedController::kIsPx4, {1, 18, 0}, "EKF2_EV_DELAY", 175, "set EKF2_EV_DELAY to 0"},
    {AskedController::kIsArduPilot, {4, 6, 0}, "VISO_TYPE", 0, "set VISO_TYPE to 1"},
    {AskedController::kIsArduPilot, {4, 7, 0}, "VISO_ORIENT", 4, "set VISO_ORIENT to 0"},
    {AskedController::kIsArduPilot, {4, 7, 0}, "EK3_SRC1_POSXY", 3, "set EK3_SRC1_POSXY to 6"},
    {AskedController::kIsArduPilot, {4, 7, 0}, "EK3_SRC1_YAW", 0, "set EK3_SRC1_YAW to 6"},
    {AskedController::kIsArduPilot, {4, 6, 0}, "GPS1_TYPE", 1, "set GPS1_TYPE to 0"},
    {AskedController::kIsArduPilot, {4, 7, 0}, "AHRS_EKF_TYPE", 10, "set AHRS_EKF_TYPE to 3"},
};

/// As the guides have them.
std::map<std::string, double> right_ones(std::uint8_t autopilot, unsigned minor) {
  if (autopilot == AskedController::kIsPx4)
    return {{"EKF2_EN", 1},          {"EKF2_EV_CTRL", 15},   {"EKF2_EV_QMIN", 1},
            {"EKF2_EV_NOISE_MD", 0}, {"EKF2_EV_DELAY", 0},   {"EKF2_DELAY_MAX", 200},
            {"EKF2_HGT_REF", 3},     {"EKF2_GPS_CTRL", 0},   {"EKF2_MAG_TYPE", 5},
            {"SYS_HAS_MAG", 0},      {"EKF2_SENS_EN", 8191}, {"EKF2_EVA_NOISE", minor < 18 ? 0.05 : 0.1}};
  return {{"AHRS_EKF_TYPE", 3}, {"EK3_ENABLE", 1},    {"VISO_TYPE", 1},      {"VISO_ORIENT", 0},
          {"VISO_SCALE", 1},    {"VISO_QUAL_MIN", 1}, {"EK3_SRC1_POSXY", 6}, {"EK3_SRC1_VELXY", 6},
          {"EK3_SRC1_POSZ", 6}, {"EK3_SRC1_VELZ", 6}, {"EK3_SRC1_YAW", 6},   {"COMPASS_ENABLE", 0},
          {"GPS1_TYPE", 0},     {"VISO_DELAY_MS", 10}};
}

/// What the check says of the controller; `changed`: with its one wrong parameter.
std::string said_of(const Wrong& wrong, bool changed) {
  mavlink::PseudoTerminal line;
  AskedController controller(line.peer, wrong.autopilot, wrong.version);
  controller.parameters = right_ones(wrong.autopilot, wrong.version[1]);
  if (changed) controller.parameters[wrong.name] = wrong.value;
  line.peer.on_packet = [&](const mavlink::Packet& packet) { controller.receive(packet, monotonic_ns()); };
  std::atomic<bool> ends{false};
  std::thread at_the_other_end([&] {
    for (int i = 0; !ends; ++i) {
      if (i % 100 == 0) controller.heartbeat();
      line.peer.read();
      ::usleep(10'000);
    }
  });
  const fs::path file = scratch() / (wrong.name + (changed ? "_wrong" : "_right"));
  write(file, "[mavlink]\nserial = \"" + line.path() + "\"\n");
  std::string said;
  // a busy computer gets more time to hear all answers
  for (int seconds = 4; seconds <= 32 && said.find(" parameters compared") == std::string::npos; seconds *= 2) {
    const std::string command = std::string(EPILINE_PROGRAM) + " check --seconds " + std::to_string(seconds) +
                                " --config '" + file.string() + "' >'" + file.string() + ".txt' 2>&1";
    [[maybe_unused]] const int rc = std::system(command.c_str());  // 1: neither camera nor IMU
    said.clear();
    std::ifstream lines(file.string() + ".txt");
    for (std::string one; std::getline(lines, one);)
      if (one.find("  mavlink: ") != std::string::npos) said += one + "\n";
  }
  ends = true;
  at_the_other_end.join();
  return said;
}

TEST(CheckOfAController, NamesTwelveWrongParametersAndNoRightOne) {
  fs::remove_all(scratch());
  std::vector<std::future<std::string>> wrong, right;
  for (const Wrong& w : kWrong) {
    wrong.push_back(std::async(std::launch::async, said_of, w, true));
    right.push_back(std::async(std::launch::async, said_of, w, false));
  }
  for (std::size_t i = 0; i < std::size(kWrong); ++i) {
    const std::string said = wrong[i].get(), of_right = right[i].get();
    EXPECT_NE(said.find(kWrong[i].name + " is "), std::string::npos) << said;
    EXPECT_NE(said.find(kWrong[i].remedy), std::string::npos) << said;
    EXPECT_NE(of_right.find(" parameters compared"), std::string::npos) << of_right;
    EXPECT_EQ(of_right.find("; set "), std::string::npos) << of_right;
  }
  fs::remove_all(scratch());
}

}  // namespace
}  // namespace epiline
