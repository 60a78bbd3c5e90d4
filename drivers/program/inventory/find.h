#pragma once
// How find_parts() finds each kind of part: by the small files and folders in which the kernel describes devices.
#include <linux/gpio.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "drivers/program/inventory/inventory.h"
#include "drivers/program/inventory/parts.h"

namespace epiline {

/// Empty if the file cannot be read.
std::string first_line(const std::filesystem::path& file);
/// The entries of a folder in alphabetical order; empty if there is no such folder.
std::vector<std::filesystem::path> entries(const std::filesystem::path& folder, const std::string& prefix);
/// The link to the device file in a folder of links such as "dev/serial/by-id"; empty: there is none.
std::string lasting_name(const std::filesystem::path& root, const char* folder, const std::filesystem::path& file_name);
/// False: failed; errno holds the reason.
bool read_chip(const std::filesystem::path& chip, gpiochip_info& info, SystemCalls& system);
/// The device file of `path` below `root`.
std::filesystem::path below(const std::filesystem::path& root, const std::string& path);
/// What keeps this user from opening the device file; empty: nothing, or the file does not exist.
std::string no_permission(const std::filesystem::path& root, const std::string& path);

/// The part with what is known of every device file.
template <class P>
P part_of(const std::filesystem::path& root, const ListedDevice& listed) {
  P part;
  part.path = listed.path;
  part.name = listed.name;
  part.trouble = no_permission(root, listed.path);
  return part;
}

/// Nothing if the node gives no images.
std::optional<CameraPart> find_camera(const std::filesystem::path& root, const ListedDevice& listed,
                                      SystemCalls& system);
/// `listed`: the interface and its state.
CanPart find_can(const std::filesystem::path& root, const ListedDevice& listed, SystemCalls& system);

}  // namespace epiline
