// `epiline check` at a line whose controller has a wrong parameter. What it says of each:
// live/controller_advice_test.cc.
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>

#include "tests/drivers/links/mavlink/asked_controller.h"
#include "tests/drivers/links/mavlink/right_parameters.h"
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

using mavlink::AskedController;

/// A controller whose parameters are as the guides have them, but for one.
struct Controller {
  std::uint8_t autopilot;
  std::array<unsigned, 3> version;
  const mavlink::RightParameters& right;
  std::string name;  ///< of the wrong one
  double value;
  std::string remedy;
};

const Controller kControllers[] = {
    {AskedController::kIsPx4, {1, 17, 0}, mavlink::kPx4Right, "EKF2_EVA_NOISE", 0.1, "set EKF2_EVA_NOISE to 0.05"},
    {AskedController::kIsArduPilot, {4, 7, 0}, mavlink::kArduPilotRight, "VISO_ORIENT", 4, "set VISO_ORIENT to 0"},
};

/// What the check says of the controller.
std::string said_of(const Controller& c) {
  mavlink::PseudoTerminal line;
  AskedController controller(line.peer, c.autopilot, c.version);
  for (const auto& [name, value] : c.right) controller.parameters[name] = value;
  controller.parameters[c.name] = c.value;
  line.peer.on_packet = [&](const mavlink::Packet& packet) { controller.receive(packet, monotonic_ns()); };
  std::atomic<bool> ends{false};
  std::thread at_the_other_end([&] {
    for (int i = 0; !ends; ++i) {
      if (i % 100 == 0) controller.heartbeat();
      line.peer.read();
      ::usleep(10'000);
    }
  });
  const fs::path file = scratch() / c.name;
  write(file, "[mavlink]\nserial = \"" + line.path() + "\"\n");
  std::string said;
  // a busy computer gets more time to hear all answers
  for (int seconds = 4; seconds <= 32 && said.find(" parameters compared") == std::string::npos; seconds *= 2) {
    const std::string command = std::string(EPILINE_PROGRAM) + " check --seconds " + std::to_string(seconds) +
                                " --config " + in_quotes(file) + " >" + in_quotes(file) + ".txt 2>&1";
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

TEST(CheckOfAController, NamesAWrongParameterAndNoRightOne) {
  fs::remove_all(scratch());
  std::vector<std::future<std::string>> answers;
  for (const Controller& c : kControllers) answers.push_back(std::async(std::launch::async, said_of, c));
  for (std::size_t i = 0; i < std::size(kControllers); ++i) {
    const std::string said = answers[i].get();
    EXPECT_NE(said.find(kControllers[i].name + " is "), std::string::npos) << said;
    const std::size_t remedy = said.find("; " + kControllers[i].remedy);
    EXPECT_NE(remedy, std::string::npos) << said;
    EXPECT_EQ(said.find("; set "), remedy) << said;
    EXPECT_EQ(said.rfind("; set "), remedy) << said;
  }
  fs::remove_all(scratch());
}

}  // namespace
}  // namespace epiline
