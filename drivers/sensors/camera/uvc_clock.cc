#include "drivers/sensors/camera/uvc_clock.h"

#include <cstdlib>
#include <numeric>

namespace epiline {

namespace {

constexpr Span kOldest = Span::from_milliseconds(2'000);   // a payload that waited longer is of another clock
constexpr Span kLongest = Span::from_milliseconds(1'000);  // from the image to its last payload
constexpr Span kLagMost = Span::from_milliseconds(250);    // of the driver's stamp
constexpr double kPacketLagShare = 1.0 / 16;

Tick tick_of(std::uint32_t ticks_per_second) noexcept {
  const auto common = std::gcd<std::int64_t>(1'000'000'000, ticks_per_second);
  return {1'000'000'000 / common, ticks_per_second / common};
}

constexpr std::size_t kBefore = 10;  // bytes of the kernel before each header: time, frame number
constexpr std::uint8_t kImageTime = 0x04, kClock = 0x08;

std::uint64_t little_endian(std::span<const std::uint8_t> bytes) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i > 0; --i) value = value << 8 | bytes[i - 1];
  return value;
}

}  // namespace

bool take_header(std::span<const std::uint8_t>& bytes, UvcHeader& header) noexcept {
  const std::size_t length = bytes.size() > kBefore ? bytes[kBefore] : 0;
  if (length < 2 || kBefore + length > bytes.size()) {
    bytes = {};
    return false;
  }
  const std::span<const std::uint8_t> fields = bytes.subspan(kBefore, length);
  const std::uint8_t flags = fields[1];
  header = {};
  header.arrival = {static_cast<std::int64_t>(little_endian(bytes.first(8)))};
  const std::size_t clock_at = (flags & kImageTime) != 0 ? 6 : 2;
  header.has_image_time = clock_at == 6 && length >= 6;
  header.has_clock = (flags & kClock) != 0 && length >= clock_at + 6;
  if (header.has_image_time) header.image_time = static_cast<std::uint32_t>(little_endian(fields.subspan(2, 4)));
  if (header.has_clock) header.clock = static_cast<std::uint32_t>(little_endian(fields.subspan(clock_at, 4)));
  bytes = bytes.subspan(kBefore + length);
  return true;
}

std::uint32_t clock_hz_of(std::span<const std::uint8_t> descriptors, int function) noexcept {
  constexpr std::uint8_t kInterface = 4, kOfClass = 0x24, kVideo = 14, kControl = 1, kHeader = 1;
  bool is_ours = false;
  while (descriptors.size() >= 2) {
    const std::size_t length = descriptors[0];
    if (length < 2 || length > descriptors.size()) return 0;
    const std::span<const std::uint8_t> one = descriptors.first(length);
    if (one[1] == kInterface && length >= 9)
      is_ours = one[2] == function && one[5] == kVideo && one[6] == kControl;
    else if (is_ours && one[1] == kOfClass && length >= 12 && one[2] == kHeader)
      return static_cast<std::uint32_t>(little_endian(one.subspan(7, 4)));
    descriptors = descriptors.subspan(length);
  }
  return 0;
}

UvcClock::UvcClock(std::uint32_t ticks_per_second) noexcept : tick_(tick_of(ticks_per_second)), ticks_(tick_) {}

bool UvcClock::add(std::uint32_t sequence, std::span<const std::uint8_t> metadata, HostStamp now) noexcept {
  Image& image = images_[sequence % kImages];
  image = {sequence, {}, false};
  bool is_sound = true;
  while (!metadata.empty()) {
    UvcHeader header;
    const bool is_credible = take_header(metadata, header) && header.arrival.ns > 0 && header.arrival <= now &&
                             now - header.arrival < kOldest;
    is_sound = is_sound && is_credible;
    if (!is_credible || !header.has_clock) continue;
    const DeviceStamp clock = ticks_.unwrap(header.clock, header.arrival);
    sync_.update(clock, header.arrival);
    if (!header.has_image_time || image.is_known) continue;
    // the difference of two numbers of the same clock, which has turned over at most once between
    const auto ticks = static_cast<std::int32_t>(header.image_time - header.clock);
    const Span before{-static_cast<std::int64_t>(ticks) * tick_.ns / tick_.per};
    image.is_known = before.ns >= 0 && before < kLongest;
    is_sound = is_sound && image.is_known;
    image.time = clock - before;
  }
  return is_sound;
}

std::optional<HostStamp> UvcClock::time_of(std::uint32_t sequence) const noexcept {
  const Image& image = images_[sequence % kImages];
  const ClockStatus status = sync_.state().status;
  if (!image.is_known || image.sequence != sequence) return std::nullopt;
  if (status == ClockStatus::kEmpty || status == ClockStatus::kUnusable || !is_clock_time(image.time))
    return std::nullopt;
  return sync_.translate(image.time);
}

bool UvcClock::stamp(std::uint32_t sequence, HostStamp& stamp) noexcept {
  const std::optional<HostStamp> own = time_of(sequence);
  const Span lag = own ? stamp - *own : Span{};
  if (!own || std::abs(lag.ns) > kLagMost.ns) {
    stamp = stamp - Span{static_cast<std::int64_t>(lag_ns_)};
    return false;
  }
  lag_ns_ += (has_lag_ ? kPacketLagShare : 1) * (static_cast<double>(lag.ns) - lag_ns_);
  has_lag_ = true;
  stamp = *own;
  return true;
}

}  // namespace epiline
