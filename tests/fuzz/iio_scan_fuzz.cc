// Any text as the types of channels, any bytes as scans: never a crash; a layout that is accepted holds its elements;
// what is written as little-endian 64 bits comes back.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "drivers/sensors/imu/iio_device.h"
#include "drivers/sensors/imu/iio_scan.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace epiline;
  // lines of text until an empty one, then bytes
  IioScanLayout layout;
  std::size_t at = 0;
  int elements = 0;
  while (at < size) {
    std::string line;
    while (at < size && data[at] != '\n') line += static_cast<char>(data[at++]);
    ++at;
    if (line.empty()) break;
    std::array<double, 9> matrix{};
    parse_mount_matrix(line.c_str(), matrix);
    IioType type;
    if (!parse_iio_type(line.c_str(), type)) continue;
    if (type.bits + type.shift > type.storage_bits) std::abort();
    const auto channel =
        type.storage_bits == 64 && type.bits == 64 ? IioChannel::kTimestamp : static_cast<IioChannel>(elements % 6);
    layout.add(channel, elements++, type);
  }
  if (!layout.finish()) return 0;
  if (layout.bytes() == 0 || layout.bytes() > IioScanLayout::kMostBytes) std::abort();
  std::string bytes(layout.bytes(), '\0');
  if (at < size) std::copy_n(data + at, std::min(size - at, bytes.size()), bytes.begin());
  IioScan scan;
  layout.read(std::span(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()), scan);
  for (const double value : scan.axes)
    if (!(value >= -9.3e18 && value <= 1.9e19)) std::abort();
  return 0;
}
