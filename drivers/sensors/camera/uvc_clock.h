#pragma once
// A USB camera's own clock in the host's time, and the time of each image by it: what its metadata node
// (V4L2_META_FMT_UVC) tells of an image's payload headers, and its descriptors of its clock. Bytes of a device: nothing
// in them is trusted. docs/camera.md
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "platform/time/counter_unwrap.h"
#include "platform/time/one_way_sync.h"

namespace epiline {

/// A payload header.
struct UvcHeader {
  HostStamp arrival;  ///< of the payload, as the kernel stamped it
  bool has_image_time = false, has_clock = false;
  std::uint32_t image_time = 0;  ///< PTS: when the camera began to take the image, in ticks
  std::uint32_t clock = 0;       ///< SCR: the camera's clock when it made the header, in ticks
};

/// Takes the first header off `bytes`. False, and `bytes` are empty: there is no whole one.
bool take_header(std::span<const std::uint8_t>& bytes, UvcHeader& header) noexcept;

/// dwClockFrequency, ticks per second, of the camera's USB descriptors (/sys/.../descriptors); 0: they tell none.
/// `function`: number of the interface of video control; others of a device may be other cameras.
std::uint32_t clock_hz_of(std::span<const std::uint8_t> descriptors, int function) noexcept;

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
