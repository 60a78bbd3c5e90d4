#pragma once
// The finders of each kind of part, for find_parts(). `path`: of the device file below `root`, or an interface's name.
#include <optional>

#include "drivers/program/inventory/inventory.h"
#include "drivers/program/inventory/parts.h"

namespace epiline {

/// The device file of `path`.
std::filesystem::path below(const std::filesystem::path& root, const std::string& path);
/// What keeps this user from opening the device file; empty: nothing, or the file does not exist.
std::string no_permission(const std::filesystem::path& root, const std::string& path);

/// Nothing if the node gives no images.
std::optional<CameraPart> find_camera(const std::filesystem::path& root, const ListedDevice& listed,
                                      SystemCalls& system);
/// Nothing if the device has neither gyroscope nor accelerometer.
std::optional<ImuPart> find_imu(const std::filesystem::path& root, const ListedDevice& listed);
SerialPart find_serial(const std::filesystem::path& root, const ListedDevice& listed);
CanPart find_can(const std::filesystem::path& root, const ListedDevice& listed, SystemCalls& system);

}  // namespace epiline
