#pragma once
// Small files and folders in which the kernel describes devices, and what it tells of a GPIO chip.
#include <linux/gpio.h>

#include <filesystem>
#include <string>
#include <vector>

#include "platform/linux/system_calls.h"

namespace epiline {

/// Empty if the file cannot be read.
std::string first_line(const std::filesystem::path& file);
/// What is in a folder, in the order of names; nothing if there is none.
std::vector<std::filesystem::path> entries(const std::filesystem::path& folder, const std::string& prefix);
/// The link in a folder of links, such as "dev/serial/by-id", that leads to the device file; empty: none.
std::string lasting_name(const std::filesystem::path& root, const char* folder, const std::filesystem::path& file_name);
/// False: errno says why not.
bool read_chip(const std::filesystem::path& chip, gpiochip_info& info, SystemCalls& system);

}  // namespace epiline
