// What `epiline init` asks: chips, lines, ports; and what it makes of the answers.
#include "drivers/program/inventory/probe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/gpio.h>

#include <atomic>
#include <cstring>
#include <thread>

#include "drivers/program/inventory/draft.h"
#include "pipeline/config/config.h"
#include "tests/drivers/fake_kernel.h"
#include "tests/drivers/links/mavlink/link_peer.h"
#include "tests/drivers/program/must.h"

namespace epiline {
namespace {

using test::must;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

ChipPart chip_select(const std::string& path) {
  ChipPart part;
  part.path = path;
  return part;
}
SerialPart board_port(const std::string& path) {
  SerialPart part;
  part.path = path;
  part.settings = {{"mavlink.serial", path}};
  return part;
}

/// A Raspberry Pi with an ICM-42688-P, whose controller sends at one rate.
struct Board {
  Parts parts;
  std::vector<std::pair<std::string, int>> listened;
  int baud = 57'600;

  Board() {
    parts.spi = {chip_select("/dev/spidev0.0"), chip_select("/dev/spidev0.1")};
    parts.serial = {board_port("/dev/ttyAMA0"), board_port("/dev/ttyAMA10")};
    SerialPart usb = board_port("/dev/ttyUSB0");
    usb.vendor = "0403";
    parts.serial.push_back(usb);
  }
  Probes probes() {
    return {
        [](const std::string& device) { return device == "/dev/spidev0.0" ? SpiChip::kIcm42688p : SpiChip::kUnknown; },
        [this](const std::string& port, int rate, bool& is_silent) -> std::optional<HeardController> {
          listened.emplace_back(port, rate);
          is_silent = port != "/dev/ttyAMA0";
          if (is_silent || rate != baud) return std::nullopt;
          return HeardController{3, 12};
        },
        [](const Parts&, const ChipPart&) { return std::string("GPIO25"); }};
  }
};

Config config_of_board(const Board& board) {
  Config config;
  must(ConfigFile::parse(must(draft_configuration(board.parts)).toml, "draft.toml")).apply(config);
  return config;
}

TEST(Probe, FindsChipLineAndController) {
  Board board;
  probe(board.parts, board.probes());
  EXPECT_THAT(board.listened, ElementsAre(testing::Pair("/dev/ttyAMA0", 921'600), testing::Pair("/dev/ttyAMA0", 57'600),
                                          testing::Pair("/dev/ttyAMA10", 921'600)))
      << "a silent port is left at the first rate, one of USB is not opened";
  const DevicesConfig d = config_of_board(board).devices;
  EXPECT_EQ(d.imu.driver, static_cast<int>(ImuDriver::kIcm42688p));
  EXPECT_EQ(d.imu.device, "/dev/spidev0.0");
  EXPECT_EQ(d.imu.rate_hz, 500);
  EXPECT_EQ(d.imu.ready_line, "GPIO25");
  EXPECT_EQ(d.mavlink.serial, "/dev/ttyAMA0");
  EXPECT_EQ(d.mavlink.baud, 57'600);
  EXPECT_EQ(d.mavlink.system, 3);
  const auto draft = draft_configuration(board.parts);
  EXPECT_THAT(draft->chosen, Contains(HasSubstr("/dev/spidev0.0: an ICM-42688-P, ready line GPIO25")));
  EXPECT_THAT(draft->chosen, Contains(HasSubstr("/dev/ttyAMA0, PX4, by its heartbeat")));
}

TEST(Probe, TakesBothHalvesOfABmi088) {
  Board board;
  Probes probes = board.probes();
  probes.identity = [](const std::string& device) {
    return device == "/dev/spidev0.0" ? SpiChip::kBmi088Accelerometer : SpiChip::kBmi088Gyroscope;
  };
  probes.ready_line = [](const Parts&, const ChipPart& chip) {
    return chip.chip == SpiChip::kBmi088Gyroscope ? std::string() : "of the wrong half";
  };
  probe(board.parts, probes);
  const DevicesConfig d = config_of_board(board).devices;
  EXPECT_EQ(d.imu.driver, static_cast<int>(ImuDriver::kBmi088));
  EXPECT_EQ(d.imu.device, "/dev/spidev0.1");
  EXPECT_EQ(d.imu.device_accel, "/dev/spidev0.0");
  EXPECT_EQ(d.imu.ready_line, "");
  EXPECT_THAT(draft_configuration(board.parts)->missing, Contains(HasSubstr("imu.ready_line")));
  board.parts.spi.pop_back();
  board.parts.spi[0].chip = SpiChip::kBmi088Gyroscope;
  EXPECT_EQ(config_of_board(board).devices.imu.device, "") << "half a BMI088";
}

TEST(Probe, HearsAHeartbeat) {
  mavlink::PseudoTerminal line;
  const auto listen = Probes::of_this_computer().heartbeat;
  bool is_silent = false;
  EXPECT_FALSE(listen(line.path(), 921'600, is_silent));
  EXPECT_TRUE(is_silent);
  std::atomic<bool> ends{false};
  std::thread controller([&] {
    while (!ends) {
      line.peer.send(mavlink::Heartbeat{.type = 30, .autopilot = 3}, {1, 100});  // a camera
      line.peer.send(mavlink::Heartbeat{.type = 2, .autopilot = 3}, {7, 1});
      ::usleep(100'000);
    }
  });
  const auto heard = listen(line.path(), 921'600, is_silent);
  ends = true;
  controller.join();
  ASSERT_TRUE(heard);
  EXPECT_EQ(heard->system, 7);
  EXPECT_EQ(heard->autopilot, 3);
  EXPECT_FALSE(is_silent);
}

/// Five lines: a free input with a name, one without, an output, one in use, another free input.
class LinesOfAChip final : public test::FakeFile {
 public:
  int ioctl(unsigned long request, void* argument) override {
    if (request != GPIO_V2_GET_LINEINFO_IOCTL) return test::refuse(ENOTTY);
    auto& info = *static_cast<gpio_v2_line_info*>(argument);
    constexpr std::uint64_t kFlags[] = {GPIO_V2_LINE_FLAG_INPUT, GPIO_V2_LINE_FLAG_INPUT, GPIO_V2_LINE_FLAG_OUTPUT,
                                        GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_USED, GPIO_V2_LINE_FLAG_INPUT};
    const char* const names[] = {"GPIO25", "", "LED", "SPI_CE0", "GPIO26"};
    info.flags = kFlags[info.offset];
    std::strcpy(info.name, names[info.offset]);
    return 0;
  }
};

TEST(ReadyLine, IsSoughtAmongFreeInputsAlone) {
  test::FakeKernel kernel;
  kernel.devices["/dev/gpiochip0"] = std::make_shared<LinesOfAChip>();
  Parts parts;
  parts.gpio.resize(1);
  parts.gpio[0].path = "/dev/gpiochip0";
  parts.gpio[0].name = "pinctrl-rp1";
  parts.gpio[0].lines = 5;
  EXPECT_THAT(free_inputs(parts, kernel), ElementsAre("GPIO25", "pinctrl-rp1:1", "GPIO26"));
}

TEST(ReadyLine, IsTheOnlyOneAtTheChipsRate) {
  EXPECT_EQ(line_at_rate({{"a", 0}, {"b", 487}, {"c", 30}}, 500), "b");
  EXPECT_EQ(line_at_rate({{"a", 0}, {"b", 250}}, 500), "");
  EXPECT_EQ(line_at_rate({{"a", 498}, {"b", 505}}, 500), "") << "which?";
  EXPECT_EQ(line_at_rate({}, 500), "");
}

}  // namespace
}  // namespace epiline
