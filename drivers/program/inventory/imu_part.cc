#include <sstream>

#include "drivers/program/inventory/find.h"
#include "drivers/program/inventory/sysfs.h"

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

}  // namespace

std::optional<ImuPart> find_imu(const fs::path& root, const ListedDevice& listed) {
  const fs::path folder = root / "sys/bus/iio/devices" / fs::path(listed.path).filename();
  ImuPart part;
  part.path = listed.path;
  part.name = listed.name;
  part.has_gyroscope = !entries(folder, "in_anglvel_").empty();
  part.has_accelerometer = !entries(folder, "in_accel_").empty();
  if (!part.has_gyroscope && !part.has_accelerometer) return std::nullopt;
  add_rates(folder, part);
  part.trouble = no_permission(root, listed.path);
  std::error_code ignored;
  if (part.trouble.empty() && !fs::exists(folder / "scan_elements", ignored))
    part.trouble = "its kernel driver has no buffer; read the chip on SPI, or take a kernel whose driver has one";
  return part;
}

}  // namespace epiline
