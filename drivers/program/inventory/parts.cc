#include "drivers/program/inventory/parts.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/program/inventory/find.h"
#include "drivers/program/inventory/sysfs.h"
#include "platform/error/device_trouble.h"

namespace epiline {

namespace {

namespace fs = std::filesystem;

ChipPart find_spi(const fs::path& root, const ListedDevice& listed) {
  return {{listed.path, "", {{"imu.device", listed.path}}, no_permission(root, listed.path)}};
}

GpioPart find_gpio(const fs::path& root, const ListedDevice& listed, SystemCalls& system) {
  GpioPart part;
  part.path = listed.path;
  part.name = listed.name;
  part.trouble = no_permission(root, listed.path);
  if (!part.trouble.empty()) return part;
  gpiochip_info info{};
  if (!read_chip(below(root, listed.path), info, system)) {
    part.trouble = error_of(device_refusal("open", errno), part.path).text();
    return part;
  }
  part.lines = info.lines;
  const std::string chip = part.name.empty() ? fs::path(part.path).filename().string() : part.name;
  for (const char* key : {"camera.stamp_line", "imu.ready_line"}) part.settings.push_back({key, chip + ":OFFSET"});
  return part;
}

/// Selects the part by its name, which stays when file names change, unless another part has the same.
template <class P, class IsSame>
std::string selector(const std::vector<P>& all, const P& part, const std::string& otherwise, IsSame is_same) {
  const auto count = std::count_if(all.begin(), all.end(), [&](const P& other) { return is_same(other, part); });
  return part.name.empty() || count > 1 ? otherwise : part.name;
}

void set_selectors(Parts& parts) {
  const auto same_name = [](const Part& a, const Part& b) { return a.name == b.name; };
  const auto same_bus = [](const CameraPart& a, const CameraPart& b) { return a.bus == b.bus; };
  for (CameraPart& camera : parts.cameras) {
    const bool has_bus = !camera.bus.empty() && std::count_if(parts.cameras.begin(), parts.cameras.end(),
                                                              [&](const auto& c) { return same_bus(c, camera); }) == 1;
    camera.settings = {
        {"camera.device", selector(parts.cameras, camera, has_bus ? camera.bus : camera.path, same_name)}};
  }
  for (ImuPart& imu : parts.imus) {
    const std::string device = selector(parts.imus, imu, fs::path(imu.path).filename().string(), same_name);
    imu.settings = {{imu.has_gyroscope ? "imu.device" : "imu.device_accel", device}};
  }
}

}  // namespace

fs::path below(const fs::path& root, const std::string& path) { return root / fs::path(path).relative_path(); }

std::string no_permission(const fs::path& root, const std::string& path) {
  const auto remedy = permission_remedy(below(root, path));
  return remedy ? "no permission to open it; " + *remedy : "";
}

Parts find_parts(const fs::path& root, SystemCalls& system) {
  const Inventory listed = list_devices(root, system);
  Parts parts;
  for (const ListedDevice& device : listed.cameras)
    if (auto camera = find_camera(root, device, system)) parts.cameras.push_back(std::move(*camera));
  for (const ListedDevice& device : listed.iio)
    if (auto imu = find_imu(root, device)) parts.imus.push_back(std::move(*imu));
  for (const ListedDevice& device : listed.spi) parts.spi.push_back(find_spi(root, device));
  for (const ListedDevice& device : listed.serial) parts.serial.push_back(find_serial(root, device));
  for (const ListedDevice& device : listed.can) parts.can.push_back(find_can(root, device, system));
  for (const ListedDevice& device : listed.gpio) parts.gpio.push_back(find_gpio(root, device, system));
  set_selectors(parts);
  return parts;
}

}  // namespace epiline
