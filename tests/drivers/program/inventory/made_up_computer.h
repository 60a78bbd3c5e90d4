#pragma once
// A computer of tests: a folder with sys and dev, and a fake kernel behind the device files.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "tests/drivers/fake_camera.h"
#include "tests/drivers/fake_kernel.h"

namespace epiline::test {

class MadeUpComputer : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::remove_all(root_); }
  void TearDown() override { std::filesystem::remove_all(root_); }

  std::filesystem::path write(const std::string& file, const std::string& text = "") const {
    std::filesystem::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text << "\n";
    return root_ / file;
  }
  void link(const std::string& to, const std::string& name) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    std::filesystem::create_symlink(to, root_ / name);
  }
  /// Under its name on this computer, and as the program names it when it flies.
  void add(const std::string& device, const FakeKernel::File& file) {
    kernel_.devices[write(device).string()] = kernel_.devices["/" + device] = file;
  }
  std::shared_ptr<FakeCamera> add_camera(const std::string& node) {
    write("sys/class/video4linux/" + node + "/name", "as sysfs has it");
    const auto camera = std::make_shared<FakeCamera>(kernel_);
    add("dev/" + node, camera);
    return camera;
  }
  /// /dev/ttyACM0
  void add_flight_controller_on_usb() const {
    write("dev/ttyACM0");
    const std::string usb = "sys/devices/usb1/1-1/";
    write(usb + "idVendor", "3162");
    write(usb + "idProduct", "0053");
    write(usb + "manufacturer", "Holybro");
    write(usb + "product", "Pixhawk6C");
    write(usb + "1-1:1.0/bInterfaceNumber", "00");
    link((root_ / usb / "1-1:1.0").string(), "sys/class/tty/ttyACM0/device");
  }
  void add_can() const {
    write("sys/class/net/can0/type", "280");
    write("sys/class/net/can0/operstate", "up");
    write("sys/class/net/can0/ifindex", "5");
    write("sys/class/net/can0/mtu", "72");
  }

  const std::filesystem::path root_ =
      std::filesystem::path(testing::TempDir()) / ("epiline-computer-" + std::to_string(::getpid()));
  FakeKernel kernel_;
};

}  // namespace epiline::test
