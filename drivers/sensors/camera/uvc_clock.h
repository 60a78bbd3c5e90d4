#pragma once
// A USB camera's own clock in the host's time, and the time of each image by it. docs/camera.md
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/sensors/camera/uvc_metadata.h"
#include "platform/time/counter_unwrap.h"
#include "platform/time/one_way_sync.h"

namespace epiline {

/// One thread, no heap.
class UvcClock {
 public:
  /// Of a clock with so many ticks per second, at least 1000.
  explicit UvcClock(std::uint32_t ticks_per_second) noexcept;

  /// The metadata of an image, by the V4L2 driver's number of it; `now`: when they were read. False: some of them make
  /// no sense.
  bool add(std::uint32_t sequence, std::span<const std::uint8_t> metadata, HostStamp now) noexcept;

  /// `stamp`: the V4L2 driver's, of the image of this number; becomes that of the camera's clock. False: the camera
  /// told none that can be; then the driver's less its usual lag.
  bool stamp(std::uint32_t sequence, HostStamp& stamp) noexcept;

  ClockState state() const noexcept { return sync_.state(); }

 private:
  struct Image {
    std::uint32_t sequence = 0;
    DeviceStamp time;
    bool is_known = false;
  };
  static constexpr std::size_t kImages = 16;

  std::optional<HostStamp> time_of(std::uint32_t sequence) const noexcept;

  Tick tick_;
  CounterUnwrap<32> ticks_;
  OneWaySync sync_{{}};
  std::array<Image, kImages> images_{};  ///< by the number's low bits
  bool has_lag_ = false;
  double lag_ns_ = 0;  ///< usual: the driver's stamp less the camera's
};

}  // namespace epiline
