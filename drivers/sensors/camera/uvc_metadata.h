#pragma once
// What the metadata node of a USB camera (V4L2_META_FMT_UVC) tells of an image's payload headers, and what the camera's
// descriptors tell of its clock. Bytes of a device: nothing in them is trusted.
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/time/clock.h"

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

}  // namespace epiline
