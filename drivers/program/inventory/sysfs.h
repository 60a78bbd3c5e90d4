#pragma once
// Reads the small files and folders in which the kernel describes devices, and the description of a GPIO chip.
#include <linux/gpio.h>

#include <filesystem>
#include <string>
#include <vector>

#include "platform/linux/system_calls.h"

namespace epiline {

/// Empty if the file cannot be read.
std::string first_line(const std::filesystem::path& file);
/// The entries of a folder in alphabetical order; empty if there is no such folder.
std::vector<std::filesystem::path> entries(const std::filesystem::path& folder, const std::string& prefix);
/// The link to the device file in a folder of links such as "dev/serial/by-id"; empty: there is none.
std::string lasting_name(const std::filesystem::path& root, const char* folder, const std::filesystem::path& file_name);
/// False: failed; errno holds the reason.
bool read_chip(const std::filesystem::path& chip, gpiochip_info& info, SystemCalls& system);

}  // namespace epiline
