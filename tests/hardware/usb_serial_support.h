#pragma once
// A serial line on USB, both its ends in this machine: the kernel's serial gadget behind its virtual bus (dummy_hcd,
// usb_f_acm, cdc-acm). Its cable is a line in a file.
#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/hardware/support.h"

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
    write_file(kFolder + "/idVendor", "0x1209\n");
    write_file(kFolder + "/idProduct", "1\n");
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
    write_file(kFolder + "/UDC", "dummy_udc.0\n");
    ASSERT_TRUE(within(60, [] { return std::filesystem::exists(kOurs); })) << "no " << kOurs;
  }
  void unplug() const {
    std::ofstream(kFolder + "/UDC") << '\n' << std::flush;  // fails where nothing was plugged in
    within(60, [] { return !std::filesystem::exists(kOurs); });
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
  const std::string kFolder = "/sys/kernel/config/usb_gadget/epiline";
};

}  // namespace epiline
