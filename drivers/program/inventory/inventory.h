#pragma once
// The computer's devices as the kernel lists them.
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "platform/linux/system_calls.h"

namespace epiline {

struct ListedDevice {
  std::string path;  ///< or the name of a network interface
  std::string name;  ///< as its driver calls it; may be empty
};

struct Inventory {
  std::vector<ListedDevice> cameras, iio, spi, gpio, serial, can;
};

/// `root`: "/", or a folder with `sys` and `dev` in it.
Inventory list_devices(const std::filesystem::path& root = "/", SystemCalls& system = SystemCalls::of_this_computer());

/// "/dev/video0 (HD USB Camera), /dev/video2 (...)", or "none".
std::string to_text(const std::vector<ListedDevice>& devices);

/// What to do if this user has no permission to open the device file; empty if permitted, or if there is no such file.
std::optional<std::string> permission_remedy(const std::filesystem::path& device);

}  // namespace epiline
