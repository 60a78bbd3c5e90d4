#pragma once
// A serial line on USB, both its ends in this machine: the kernel's serial gadget behind its virtual bus (dummy_hcd,
// usb_f_acm, cdc-acm). Its cable is a line in a file.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <termios.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "platform/time/monotonic.h"

namespace epiline {

class SerialGadget {
 public:
  static constexpr const char* kOurs = "/dev/ttyACM0";
  static constexpr const char* kTheirs = "/dev/ttyGS0";

  static bool can_be_had() { return std::filesystem::exists("/sys/kernel/config/usb_gadget"); }

  SerialGadget() {
    namespace fs = std::filesystem;
    fs::create_directories(kFolder + "/functions/acm.0");
    fs::create_directories(kFolder + "/configs/c.1");
    write_line(kFolder + "/idVendor", "0x1209");
    write_line(kFolder + "/idProduct", "1");
    fs::create_directory_symlink(kFolder + "/functions/acm.0", kFolder + "/configs/c.1/acm.0");
  }
  ~SerialGadget() {
    namespace fs = std::filesystem;
    unplug();
    fs::remove(kFolder + "/configs/c.1/acm.0");
    fs::remove(kFolder + "/configs/c.1");
    fs::remove(kFolder + "/functions/acm.0");
    fs::remove(kFolder);
  }
  SerialGadget(const SerialGadget&) = delete;
  SerialGadget& operator=(const SerialGadget&) = delete;

  void plug_in() {
    write_line(kFolder + "/UDC", "dummy_udc.0");
    ASSERT_TRUE(wait_until([] { return std::filesystem::exists(kOurs); })) << "no " << kOurs;
  }
  void unplug() const {
    std::ofstream(kFolder + "/UDC") << '\n' << std::flush;
    wait_until([] { return !std::filesystem::exists(kOurs); });
  }
  /// The flight controller's end, raw; whoever gets it closes it, also after each unplugging.
  static int open_their_end() {
    const int fd = ::open(kTheirs, O_RDWR | O_NOCTTY | O_NONBLOCK);
    EXPECT_GE(fd, 0);
    termios raw{};
    ::tcgetattr(fd, &raw);
    ::cfmakeraw(&raw);
    ::tcsetattr(fd, TCSANOW, &raw);
    return fd;
  }

 private:
  static void write_line(const std::string& path, const std::string& text) {
    std::ofstream file(path);
    file << text << '\n' << std::flush;
    ASSERT_TRUE(file) << path;
  }
  static bool wait_until(const std::function<bool()>& done) {
    constexpr std::int64_t kLong_ns = 60'000'000'000;  // an emulated computer
    const std::int64_t until_ns = monotonic_ns() + kLong_ns;
    while (!done() && monotonic_ns() < until_ns) ::usleep(1000);
    return done();
  }

  const std::string kFolder = "/sys/kernel/config/usb_gadget/epiline";
};

}  // namespace epiline
