#pragma once
// The metadata node beside a USB camera's video node: the payload headers of each image. No heap, no exceptions.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/sensors/camera/v4l2_device.h"
#include "platform/error/device_trouble.h"
#include "platform/linux/system_calls.h"

namespace epiline {

class MetadataNode {
 public:
  explicit MetadataNode(SystemCalls& system) noexcept : system_(system) {}
  ~MetadataNode() { close(); }
  MetadataNode(const MetadataNode&) = delete;
  MetadataNode& operator=(const MetadataNode&) = delete;

  /// Finds the node of this open camera and begins to take its metadata; before the camera's own stream begins.
  DeviceTrouble open(const V4l2Device& camera) noexcept;
  void close() noexcept;

  /// The metadata of the oldest image not read yet, valid until the next call. False: there are none.
  bool read(std::uint32_t& sequence, std::span<const std::uint8_t>& metadata) noexcept;

 private:
  static constexpr unsigned kBuffers = 8;
  struct Memory {
    std::uint8_t* data = nullptr;
    std::size_t length = 0;
  };

  int call(unsigned long request, void* argument) const noexcept {
    return call_device(system_, fd_, request, argument);
  }
  bool find(const V4l2Device& camera) noexcept;
  DeviceTrouble begin() noexcept;
  DeviceTrouble map(unsigned index) noexcept;
  int queue(unsigned index) noexcept;

  SystemCalls& system_;
  int fd_ = -1;
  std::array<Memory, kBuffers> buffers_{};
  unsigned count_ = 0;
  int held_ = -1;  ///< the buffer of the last read()
};

/// Ticks per second of the camera's clock, by its USB descriptors; 0: they do not tell.
std::uint32_t clock_hz_of(SystemCalls& system, const V4l2Device& camera) noexcept;

}  // namespace epiline
