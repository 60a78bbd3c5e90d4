// `epiline devices` on made-up computers: a folder with sys and dev, and a fake kernel behind the device files.
#include "drivers/program/inventory/parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can/netlink.h>
#include <linux/gpio.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/program/inventory/parts_json.h"
#include "tests/drivers/program/inventory/made_up_computer.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

/// A video node that gives metadata, as each UVC camera has one.
class NodeOfMetadata final : public test::FakeFile {
 public:
  int ioctl(unsigned long request, void* argument) override {
    if (request != VIDIOC_QUERYCAP) return test::refuse(ENOTTY);
    static_cast<v4l2_capability*>(argument)->capabilities = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
    return 0;
  }
};

class UnpluggedNow final : public test::FakeFile {
 public:
  int opened() override { return ENODEV; }
};

class Chip final : public test::FakeFile {
 public:
  int ioctl(unsigned long request, void* argument) override {
    if (request != GPIO_GET_CHIPINFO_IOCTL) return test::refuse(ENOTTY);
    auto& info = *static_cast<gpiochip_info*>(argument);
    std::strcpy(info.label, "pinctrl-rp1");
    info.lines = 54;
    return 0;
  }
};

/// Answers a request for a link's facts as the kernel does, within write().
class Netlink final : public test::FakeFile {
 public:
  int asked_index = 0;
  std::vector<std::uint8_t> answer;

  Netlink(std::uint32_t state, std::uint32_t bitrate, std::uint32_t data_bitrate, unsigned flags) {
    std::vector<std::uint8_t> controller, info;
    add(controller, IFLA_CAN_BITTIMING, timing(bitrate));
    add(controller, IFLA_CAN_DATA_BITTIMING, timing(data_bitrate));
    add(controller, IFLA_CAN_STATE, bytes_of(state));
    add(info, IFLA_INFO_KIND, {'c', 'a', 'n', 0});
    add(info, IFLA_INFO_DATA, controller);
    ifinfomsg link{};
    link.ifi_flags = flags;
    nlmsghdr header{};
    header.nlmsg_type = RTM_NEWLINK;
    answer = bytes_of(header);
    const auto of_link = bytes_of(link);
    answer.insert(answer.end(), of_link.begin(), of_link.end());
    add(answer, IFLA_IFNAME, {'c', 'a', 'n', '0', 0});
    add(answer, IFLA_LINKINFO, info);
    const auto size = static_cast<std::uint32_t>(answer.size());
    std::memcpy(answer.data(), &size, sizeof size);
  }
  ssize_t write(const void* from, std::size_t size) override {
    asked_index = reinterpret_cast<const ifinfomsg*>(static_cast<const std::uint8_t*>(from) + NLMSG_HDRLEN)->ifi_index;
    return static_cast<ssize_t>(size);
  }
  ssize_t read(void* into, std::size_t size) override {
    const std::size_t count = std::min(size, answer.size());
    std::memcpy(into, answer.data(), count);
    return static_cast<ssize_t>(count);
  }

 private:
  template <class T>
  static std::vector<std::uint8_t> bytes_of(const T& value) {
    const auto* begin = reinterpret_cast<const std::uint8_t*>(&value);
    return {begin, begin + sizeof value};
  }
  static std::vector<std::uint8_t> timing(std::uint32_t bitrate) {
    can_bittiming value{};
    value.bitrate = bitrate;
    return bytes_of(value);
  }
  static void add(std::vector<std::uint8_t>& to, int type, const std::vector<std::uint8_t>& payload) {
    const auto header =
        bytes_of(rtattr{static_cast<unsigned short>(RTA_LENGTH(payload.size())), static_cast<unsigned short>(type)});
    to.insert(to.end(), header.begin(), header.end());
    to.insert(to.end(), payload.begin(), payload.end());
    to.resize(to.size() + RTA_ALIGN(payload.size()) - payload.size());
  }
};

class PartsOf : public test::MadeUpComputer {
 protected:
  void add_can(const std::shared_ptr<Netlink>& link) {
    MadeUpComputer::add_can();
    write("sys/class/net/can0/device/uevent");
    kernel_.make_socket = [link](int domain, int, int) { return domain == AF_NETLINK ? link : nullptr; };
  }
  Parts find() { return find_parts(root_, kernel_); }
};

TEST_F(PartsOf, AnEmptyComputerHasNone) {
  EXPECT_EQ(to_text(find()),
            "camera    none\nimu       none\nspi       none\nserial    none\ncan       none\n"
            "gpio      none\n");
}

TEST_F(PartsOf, ACameraHasFormatsSizesRatesAndControls) {
  const auto camera = add_camera("video0");
  camera->formats.push_back({V4L2_PIX_FMT_H264, {{1280, 800, {120}}}});
  camera->formats.push_back({V4L2_PIX_FMT_SRGGB10P, {{1456, 1088, {60}}}});
  camera->controls.push_back({3, "Gain", 0, 100});
  const Parts parts = find();
  ASSERT_EQ(parts.cameras.size(), 1u);
  const CameraPart& part = parts.cameras[0];
  EXPECT_EQ(part.path, "/dev/video0");
  EXPECT_EQ(part.name, "Made-up Cam");
  EXPECT_EQ(part.driver, "uvcvideo");
  ASSERT_EQ(part.formats.size(), 3u);
  EXPECT_TRUE(part.formats[0].is_read);
  EXPECT_FALSE(part.formats[1].is_read);
  ASSERT_EQ(part.formats[0].sizes.size(), 2u);
  EXPECT_EQ(part.formats[0].sizes[0].width, 320u);
  EXPECT_THAT(part.formats[0].sizes[0].rates_hz, ElementsAre(30, 60));
  EXPECT_EQ(to_text(parts).substr(0, to_text(parts).find("imu")),
            "camera    /dev/video0  Made-up Cam  at usb-0000:00:14.0-1, driver uvcvideo\n"
            "          setting   camera.device = \"Made-up Cam\"\n"
            "          GREY      320x180 (30, 60 Hz), 640x480 (30 Hz)\n"
            "          pRAA      728x544 (60 Hz); half the camera's, of its colours\n"
            "          not read  H264\n"
            "          control   exposure_time_absolute  0 to 255, default 0\n"
            "          control   gain  0 to 100, default 0\n");
  EXPECT_EQ(kernel_.open_files(), 0u);
}

TEST_F(PartsOf, ACameraHasALastingPath) {
  add_camera("video0");
  EXPECT_EQ(find().cameras.at(0).lasting_path, "");
  for (const char* link : {"by-path/pci-0-video-index0", "by-id/usb-Made-up-video-index0"}) {
    this->link("../../video0", std::string("dev/v4l/") + link);
    EXPECT_EQ(find().cameras.at(0).lasting_path, std::string("/dev/v4l/") + link) << "by-id first";
  }
}

TEST_F(PartsOf, NodesWithoutImagesAreLeftOut) {
  add_camera("video0");
  write("sys/class/video4linux/video1/name", "Made-up Cam");
  add("dev/video1", std::make_shared<NodeOfMetadata>());
  EXPECT_EQ(find().cameras.size(), 1u);
}

TEST_F(PartsOf, CamerasOfOneNameAreSelectedByTheirPlace) {
  add_camera("video0");
  add_camera("video2")->bus = "usb-0000:00:14.0-2";
  const Parts two = find();
  EXPECT_EQ(two.cameras[0].settings[0].value, "usb-0000:00:14.0-1");
  EXPECT_EQ(two.cameras[1].settings[0].value, "usb-0000:00:14.0-2");
  add_camera("video4");  // on the first one's bus
  const Parts three = find();
  EXPECT_EQ(three.cameras[0].settings[0].value, "/dev/video0");
  EXPECT_EQ(three.cameras[1].settings[0].value, "usb-0000:00:14.0-2");
}

TEST_F(PartsOf, WhatCannotBeOpenedSaysWhy) {
  write("sys/class/video4linux/video0/name", "Camera on a loose cable");
  add("dev/video0", std::make_shared<UnpluggedNow>());
  const Parts parts = find();
  ASSERT_EQ(parts.cameras.size(), 1u);
  EXPECT_EQ(parts.cameras[0].name, "Camera on a loose cable");
  EXPECT_THAT(parts.cameras[0].trouble, HasSubstr("No such device"));
}

TEST_F(PartsOf, AMissingPermissionNamesItsGroup) {
  add_camera("video0");
  write("dev/ttyACM0");
  write("dev/spidev0.0");
  const bool is_root = ::geteuid() == 0;
  const gid_t group = is_root ? 1 : ::getgid();  // 1: daemon, wherever passwd(5) is
  for (const char* device : {"dev/video0", "dev/ttyACM0", "dev/spidev0.0"}) {
    ASSERT_EQ(::chown((root_ / device).c_str(), static_cast<uid_t>(-1), group), 0);
    fs::permissions(root_ / device, fs::perms::group_read | fs::perms::group_write);
  }
  // access(2) asks for the real user
  const auto become = [&](uid_t user) { return is_root ? ::setresuid(user, uid_t(-1), uid_t(-1)) : 0; };
  if (become(65534) != 0) GTEST_SKIP() << "no right to drop privileges";
  const Parts parts = find();
  ASSERT_EQ(become(0), 0);
  ASSERT_EQ(parts.cameras.size(), 1u);
  for (const std::string& trouble : {parts.cameras[0].trouble, parts.serial.at(0).trouble, parts.spi.at(0).trouble})
    EXPECT_THAT(trouble, HasSubstr("no permission to open it; join its group: sudo usermod -aG "));
}

TEST_F(PartsOf, AnImuHasGyroscopeAccelerometerAndRates) {
  const std::string first = "sys/bus/iio/devices/iio:device0/", second = "sys/bus/iio/devices/iio:device1/";
  write(first + "name", "icm42600-gyro");
  write(first + "in_anglvel_x_raw", "1");
  write(first + "in_anglvel_sampling_frequency", "200.000000");
  write(first + "in_anglvel_sampling_frequency_available", "12.5 25 50 100 200");
  write(first + "scan_elements/in_anglvel_x_en", "0");
  write(second + "name", "icm42600-accel");
  write(second + "in_accel_x_raw", "1");
  write("sys/bus/iio/devices/iio:device2/in_illuminance_raw", "7");
  const Parts parts = find();
  ASSERT_EQ(parts.imus.size(), 2u) << "a light sensor is none";
  EXPECT_TRUE(parts.imus[0].has_gyroscope);
  EXPECT_FALSE(parts.imus[0].has_accelerometer);
  EXPECT_EQ(parts.imus[0].rate_hz, 200);
  EXPECT_THAT(parts.imus[0].rates_hz, ElementsAre(12.5, 25, 50, 100, 200));
  EXPECT_EQ(parts.imus[0].trouble, "");
  EXPECT_EQ(parts.imus[0].settings[0].key, "imu.device");
  EXPECT_EQ(parts.imus[0].settings[0].value, "icm42600-gyro");
  EXPECT_EQ(parts.imus[1].settings[0].key, "imu.device_accel");
  EXPECT_THAT(parts.imus[1].trouble, HasSubstr("no buffer"));
}

TEST_F(PartsOf, ASerialPortNamesItsFlightController) {
  add_flight_controller_on_usb();
  write("dev/ttyAMA0");
  link("../../ttyACM0", "dev/serial/by-id/usb-Holybro_Pixhawk6C-if00");
  const Parts parts = find();
  ASSERT_EQ(parts.serial.size(), 2u);
  EXPECT_EQ(parts.serial[0].vendor + ":" + parts.serial[0].product, "3162:0053");
  EXPECT_EQ(parts.serial[0].name, "Holybro Pixhawk6C");
  EXPECT_EQ(parts.serial[0].autopilot, "Holybro flight controller");
  EXPECT_EQ(parts.serial[0].settings[0].value, "/dev/serial/by-id/usb-Holybro_Pixhawk6C-if00");
  EXPECT_EQ(parts.serial[1].autopilot, "");
  EXPECT_EQ(parts.serial[1].settings[0].value, "/dev/ttyAMA0");
}

TEST_F(PartsOf, ACanInterfaceHasStateAndBitRates) {
  const auto link = std::make_shared<Netlink>(CAN_STATE_ERROR_PASSIVE, 1'000'000, 5'000'000, IFF_UP);
  add_can(link);
  const CanPart part = find().can.at(0);
  EXPECT_EQ(link->asked_index, 5);
  EXPECT_TRUE(part.is_up);
  EXPECT_TRUE(part.has_fd);
  EXPECT_EQ(part.state, "error-passive");
  EXPECT_EQ(part.bitrate, 1'000'000u);
  EXPECT_EQ(part.data_bitrate, 5'000'000u);
  EXPECT_EQ(part.trouble, "");
  EXPECT_THAT(to_text(find()), HasSubstr("can0  up, error-passive, 1000000 bit/s, data 5000000 bit/s, FD\n"));
}

TEST_F(PartsOf, ACanInterfaceThatIsDownSaysHowToStartIt) {
  add_can(std::make_shared<Netlink>(CAN_STATE_STOPPED, 0, 0, 0));
  const CanPart part = find().can.at(0);
  EXPECT_FALSE(part.is_up);
  EXPECT_EQ(part.state, "stopped");
  EXPECT_EQ(part.trouble, "it is down; sudo ip link set can0 up type can bitrate BITRATE");
}

TEST_F(PartsOf, AnAnswerOfTheKernelThatIsCutIsNotRead) {
  const auto link = std::make_shared<Netlink>(CAN_STATE_BUS_OFF, 1'000'000, 0, IFF_UP);
  add_can(link);
  const std::vector<std::uint8_t> whole = link->answer;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    link->answer.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    const CanPart part = find().can.at(0);
    EXPECT_EQ(part.bitrate, 0u) << size;
    EXPECT_EQ(part.state, "up") << size << ": what sysfs has";
  }
}

TEST_F(PartsOf, ThisKernelAnswersForALink) {
  // the loopback interface, as if it were a CAN bus; it has number 1 in every network namespace
  write("sys/class/net/lo/type", "280");
  write("sys/class/net/lo/ifindex", "1");
  ifreq asked{};
  std::strcpy(asked.ifr_name, "lo");
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ASSERT_EQ(::ioctl(fd, SIOCGIFFLAGS, &asked), 0);
  ::close(fd);
  for (const char* says : {"up", "down"}) {
    write("sys/class/net/lo/operstate", says);
    const CanPart part = find_parts(root_).can.at(0);
    EXPECT_EQ(part.is_up, (asked.ifr_flags & IFF_UP) != 0) << "whatever sysfs says";
    EXPECT_EQ(part.bitrate, 0u);
  }
}

TEST_F(PartsOf, AGpioChipHasLabelAndLines) {
  add("dev/gpiochip0", std::make_shared<Chip>());
  const Parts parts = find();
  ASSERT_EQ(parts.gpio.size(), 1u);
  EXPECT_EQ(parts.gpio[0].name, "pinctrl-rp1");
  EXPECT_EQ(parts.gpio[0].lines, 54u);
  EXPECT_EQ(parts.gpio[0].settings[0].value, "pinctrl-rp1:OFFSET");
}

TEST_F(PartsOf, JsonHoldsThemAll) {
  add_camera("video0");
  write("dev/spidev0.0");
  add_can(std::make_shared<Netlink>(CAN_STATE_ERROR_ACTIVE, 500'000, 0, IFF_UP));
  auto json = to_json(find());
  EXPECT_EQ(json["cameras"][0]["settings"]["camera.device"], "Made-up Cam");
  EXPECT_EQ(json["cameras"][0]["formats"][0]["sizes"][0]["rates_hz"][1], 60);
  EXPECT_EQ(json["cameras"][0]["controls"][0]["max"], 255);
  EXPECT_EQ(json["spi"][0]["settings"]["imu.device"], "/dev/spidev0.0");
  EXPECT_EQ(json["can"][0]["bitrate"], 500'000);
  EXPECT_TRUE(json["can"][0]["data_bitrate"].is_null());
  for (const char* kind : {"imus", "serial", "gpio"}) EXPECT_TRUE(json[kind].is_array() && json[kind].empty()) << kind;
}

}  // namespace
}  // namespace epiline
