// Any bytes as frames of a CAN bus, read as a vehicle's speed by settings that are any bytes as well: never a crash;
// what comes out is finite, rises in time and is not of the future; and a sound frame behind it all is read.
#include <linux/can.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "drivers/sensors/wheel/can_wheel_source.h"
#include "platform/time/monotonic.h"

using namespace epiline;

namespace {

struct Input {
  const std::uint8_t* data;
  std::size_t size;
  template <class T>
  T take() {
    T value{};
    const std::size_t n = std::min(sizeof value, size);
    std::memcpy(&value, data, n);
    data += n;
    size -= n;
    return value;
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input{data, size};
  WheelConfig config;
  BusSignal& signal = config.signal;
  signal.id = input.take<std::uint16_t>() & CAN_SFF_MASK;
  signal.start_bit = input.take<std::int16_t>();
  signal.length = input.take<std::int8_t>();
  const auto flags = input.take<std::uint8_t>();
  signal.big_endian = (flags & 1) != 0;
  signal.is_signed = (flags & 2) != 0;
  signal.scale = input.take<double>();
  signal.offset = input.take<double>();
  CanWheelSource source(config);
  const std::int64_t began_ns = monotonic_ns();
  HostStamp last{began_ns - 2'000'000'000};
  WheelSample sample;
  while (input.size > 0) {
    ArrivalStamps stamps;
    if ((flags & 4) != 0) stamps.of_day_ns = ClockPair::now().of_day_ns - input.take<std::int32_t>();
    if ((flags & 8) != 0) stamps.hardware_ns = input.take<std::int64_t>();
    if ((flags & 16) != 0) stamps.of_day_ns = input.take<std::int64_t>();
    std::vector<std::uint8_t> frame(std::min<std::size_t>(input.take<std::uint8_t>() % 80U, input.size));
    for (std::uint8_t& byte : frame) byte = input.take<std::uint8_t>();
    if ((flags & 32) != 0 && frame.size() >= 4) {  // often enough ours
      std::memcpy(frame.data(), &signal.id, sizeof signal.id);
    }
    if (!source.decode(frame, stamps, sample)) continue;
    if (!std::isfinite(sample.forward_speed_m_s) || sample.stamp < last || sample.stamp.ns > monotonic_ns())
      std::abort();
    last = sample.stamp;
  }
  canfd_frame sound{};
  sound.can_id = signal.id;
  sound.len = CANFD_MAX_DLEN;
  const bool readable = value_of(signal, {sound.data, sound.len}).has_value();
  std::vector<std::uint8_t> bytes(CANFD_MTU);
  std::memcpy(bytes.data(), &sound, bytes.size());
  if (source.decode(bytes, {}, sample) != readable) std::abort();
  return 0;
}
