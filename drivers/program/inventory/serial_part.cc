#include <string_view>

#include "drivers/program/inventory/find.h"
#include "drivers/program/inventory/sysfs.h"

namespace epiline {

namespace {

namespace fs = std::filesystem;

struct KnownUsb {
  std::string_view vendor, product;  ///< product empty: any
  std::string_view name;
};
constexpr KnownUsb kAutopilots[] = {
#define EPILINE_TTY(name, listed)
#define EPILINE_AUTOPILOT(vendor, product, name, sure) {vendor, product, name},
#include "drivers/program/inventory/serial_devices.inc"
#undef EPILINE_TTY
#undef EPILINE_AUTOPILOT
};

std::string autopilot_of(const std::string& vendor, const std::string& product) {
  for (const KnownUsb& known : kAutopilots)
    if (vendor == known.vendor && (known.product.empty() || product == known.product)) return std::string(known.name);
  return {};
}

/// The folder of the USB device that the port is a part of; empty: it is on no USB.
fs::path usb_device_of(const fs::path& port) {
  std::error_code none;
  fs::path folder = fs::canonical(port / "device", none);
  for (; !none && folder.has_relative_path(); folder = folder.parent_path())
    if (fs::exists(folder / "idVendor", none)) return folder;
  return {};
}

}  // namespace

SerialPart find_serial(const fs::path& root, const ListedDevice& listed) {
  const fs::path file_name = fs::path(listed.path).filename();
  SerialPart part;
  part.path = listed.path;
  part.trouble = no_permission(root, listed.path);
  if (const fs::path usb = usb_device_of(root / "sys/class/tty" / file_name); !usb.empty()) {
    part.vendor = first_line(usb / "idVendor");
    part.product = first_line(usb / "idProduct");
    const std::string maker = first_line(usb / "manufacturer");
    part.name = maker + (maker.empty() ? "" : " ") + first_line(usb / "product");
    part.autopilot = autopilot_of(part.vendor, part.product);
  }
  const std::string lasting = lasting_name(root, "dev/serial/by-id", file_name);
  part.settings = {{"mavlink.serial", lasting.empty() ? part.path : lasting}};
  return part;
}

}  // namespace epiline
