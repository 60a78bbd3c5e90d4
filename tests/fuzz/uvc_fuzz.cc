// Any bytes as what a USB camera tells: its descriptors, and the metadata of its images, cut into pieces of the length
// that the first byte says. Then an image is stamped not far from the driver's stamp, whatever was told.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "drivers/sensors/camera/uvc_clock.h"

using namespace epiline;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  std::span<const std::uint8_t> bytes(data, size);
  clock_hz_of(bytes, data[0] % 4);
  const std::size_t piece = 1 + data[0];
  bytes = bytes.subspan(1);
  UvcClock clock(48'000'000);
  for (std::uint32_t sequence = 0; !bytes.empty(); ++sequence) {
    const std::size_t length = std::min(piece, bytes.size());
    HostStamp now{1'000'000'000 + std::int64_t{33'000'000} * sequence};
    clock.add(sequence, bytes.first(length), now);
    HostStamp stamp = now;
    clock.stamp(sequence, stamp);
    if (std::abs((stamp - now).ns) > 250'000'000) std::abort();
    bytes = bytes.subspan(length);
  }
  return 0;
}
