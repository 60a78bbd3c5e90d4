#include "drivers/program/inventory/inventory.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <linux/gpio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "drivers/program/inventory/find.h"

namespace epiline {

namespace fs = std::filesystem;

std::string first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

std::vector<fs::path> entries(const fs::path& folder, const std::string& prefix) {
  std::vector<fs::path> found;
  std::error_code none;
  for (fs::directory_iterator it(folder, none), end; !none && it != end; it.increment(none))
    if (it->path().filename().string().rfind(prefix, 0) == 0) found.push_back(it->path());
  std::sort(found.begin(), found.end());
  return found;
}

std::string lasting_name(const fs::path& root, const char* folder, const fs::path& file_name) {
  for (const fs::path& link : entries(root / folder, "")) {
    std::error_code none;
    if (fs::read_symlink(link, none).filename() == file_name)
      return (fs::path("/") / folder / link.filename()).string();
  }
  return {};
}

bool read_chip(const fs::path& chip, gpiochip_info& info, SystemCalls& system) {
  const int fd = system.open(chip.c_str(), O_RDWR);
  if (fd < 0) return false;
  const bool is_told = system.ioctl(fd, GPIO_GET_CHIPINFO_IOCTL, &info) == 0;
  const int error = errno;
  system.close(fd);
  errno = error;
  return is_told;
}

namespace {

/// Adds the entries of a folder as device files, with the names that `name_of` gives.
template <class NameOf>
void add_devices(const fs::path& folder, const char* prefix, NameOf name_of, std::vector<ListedDevice>& devices) {
  for (const fs::path& entry : entries(folder, prefix))
    devices.push_back({"/dev/" + entry.filename().string(), name_of(entry)});
}

/// The driver's name of a chip, which the kernel shows in no file. Empty: this user may not open the chip.
std::string label_of(const fs::path& chip, SystemCalls& system) {
  gpiochip_info info{};
  if (!read_chip(chip, info, system)) return {};
  return {info.label, ::strnlen(info.label, sizeof(info.label))};
}

struct SerialKind {
  const char* prefix;
  bool is_listed;
};
constexpr SerialKind kSerialKinds[] = {
#define LISTED true
#define UNLISTED false
#define EPILINE_TTY(name, listed) {name, listed},
#define EPILINE_AUTOPILOT(vendor, product, name, sure)
#include "drivers/program/inventory/serial_devices.inc"
#undef EPILINE_TTY
#undef EPILINE_AUTOPILOT
#undef LISTED
#undef UNLISTED
};

}  // namespace

Inventory list_devices(const fs::path& root, SystemCalls& system) {
  Inventory all;
  const fs::path sys = root / "sys", dev = root / "dev";
  const auto in_sysfs = [](const fs::path& entry) { return first_line(entry / "name"); };
  const auto nameless = [](const fs::path&) { return std::string(); };
  add_devices(sys / "class/video4linux", "video", in_sysfs, all.cameras);
  add_devices(sys / "bus/iio/devices", "iio:device", in_sysfs, all.iio);
  add_devices(
      dev, "gpiochip", [&](const fs::path& chip) { return label_of(chip, system); }, all.gpio);
  add_devices(dev, "spidev", nameless, all.spi);
  for (const auto& [prefix, is_listed] : kSerialKinds)
    if (is_listed) add_devices(dev, prefix, nameless, all.serial);
  constexpr const char* kCanType = "280";  // ARPHRD_CAN
  for (const fs::path& entry : entries(sys / "class/net", ""))
    if (first_line(entry / "type") == kCanType)
      all.can.push_back({entry.filename().string(), first_line(entry / "operstate")});
  return all;
}

std::string to_text(const std::vector<ListedDevice>& devices) {
  std::string text;
  for (const ListedDevice& d : devices) {
    text += fmt::format("{}{}", text.empty() ? "" : ", ", d.path);
    if (!d.name.empty()) text += fmt::format(" ({})", d.name);
  }
  return text.empty() ? "none" : text;
}

std::optional<std::string> permission_remedy(const fs::path& device) {
  if (::access(device.c_str(), R_OK | W_OK) == 0 || errno != EACCES) return std::nullopt;
  struct stat status {};
  if (::stat(device.c_str(), &status) != 0) return "run as a user with access to the folder of " + device.string();
  std::array<char, 4096> text{};
  group entry{};
  group* found = nullptr;
  const bool group_may = (status.st_mode & (S_IRGRP | S_IWGRP)) == (S_IRGRP | S_IWGRP);
  if (group_may && status.st_gid != 0 && ::getgrgid_r(status.st_gid, &entry, text.data(), text.size(), &found) == 0 &&
      found != nullptr) {
    return fmt::format("join its group: sudo usermod -aG {} $USER, then log in again", found->gr_name);
  }
  return fmt::format("add a udev rule that gives {} to one of your groups", device.string());
}

}  // namespace epiline
