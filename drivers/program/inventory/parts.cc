#include "drivers/program/inventory/parts.h"

#include <algorithm>
#include <cerrno>
#include <sstream>
#include <string_view>

#include "drivers/program/inventory/find.h"
#include "platform/error/device_trouble.h"

namespace epiline {

namespace {

namespace fs = std::filesystem;

/// As IioDevice::set_rate() looks for it.
constexpr const char* kRateFiles[] = {"sampling_frequency", "in_anglvel_sampling_frequency",
                                      "in_accel_sampling_frequency"};

std::vector<double> numbers_in(const std::string& text) {
  std::istringstream in(text);
  std::vector<double> numbers;
  for (double number = 0; in >> number;) numbers.push_back(number);
  return numbers;
}

void add_rates(const fs::path& folder, ImuPart& part) {
  for (const char* file : kRateFiles) {
    const auto now = numbers_in(first_line(folder / file));
    if (part.rate_hz <= 0 && now.size() == 1) part.rate_hz = now.front();
    if (part.rates_hz.empty()) part.rates_hz = numbers_in(first_line(folder / (std::string(file) + "_available")));
  }
}

std::optional<ImuPart> find_imu(const fs::path& root, const ListedDevice& listed) {
  const fs::path folder = root / "sys/bus/iio/devices" / fs::path(listed.path).filename();
  auto part = part_of<ImuPart>(root, listed);
  part.has_gyroscope = !entries(folder, "in_anglvel_").empty();
  part.has_accelerometer = !entries(folder, "in_accel_").empty();
  if (!part.has_gyroscope && !part.has_accelerometer) return std::nullopt;
  add_rates(folder, part);
  std::error_code ignored;
  if (part.trouble.empty() && !fs::exists(folder / "scan_elements", ignored))
    part.trouble = "its kernel driver has no buffer; read the chip on SPI, or take a kernel whose driver has one";
  return part;
}

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

SerialPart find_serial(const fs::path& root, const ListedDevice& listed) {
  const fs::path file_name = fs::path(listed.path).filename();
  auto part = part_of<SerialPart>(root, listed);
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

ChipPart find_spi(const fs::path& root, const ListedDevice& listed) {
  auto part = part_of<ChipPart>(root, listed);
  part.settings = {{"imu.device", listed.path}};
  return part;
}

GpioPart find_gpio(const fs::path& root, const ListedDevice& listed, SystemCalls& system) {
  auto part = part_of<GpioPart>(root, listed);
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

/// A text that selects this part alone: `one` of it if it has that and no other part has the same, else `otherwise`.
template <class P, class Base>
std::string selector(const std::vector<P>& all, const P& part, std::string Base::*one, const std::string& otherwise) {
  const auto count = std::count_if(all.begin(), all.end(), [&](const P& p) { return p.*one == part.*one; });
  return (part.*one).empty() || count > 1 ? otherwise : part.*one;
}

/// By its name, which stays when file names change.
void set_selectors(Parts& parts) {
  for (CameraPart& camera : parts.cameras) {
    const std::string place = selector(parts.cameras, camera, &CameraPart::bus, camera.path);
    camera.settings = {{"camera.device", selector(parts.cameras, camera, &Part::name, place)}};
  }
  for (ImuPart& imu : parts.imus) {
    const std::string device = selector(parts.imus, imu, &Part::name, fs::path(imu.path).filename().string());
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
