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

}  // namespace

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
