#pragma once
// The writing end of a v4l2loopback device: readers of the device get the written images as those of a camera.
#include <array>
#include <cstddef>
#include <string>

#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Writes 8-bit grey images. One thread uses it.
class LoopbackWriter {
 public:
  LoopbackWriter() = default;
  ~LoopbackWriter() { close(); }
  LoopbackWriter(const LoopbackWriter&) = delete;
  LoopbackWriter& operator=(const LoopbackWriter&) = delete;

  /// Sets the device's format and the rate that it reports (0: none). Readers can open the device after that.
  Status open(const std::string& device, int width, int height, double rate_hz = 0);
  void close() noexcept;
  /// Passes the timestamp on, cut to microseconds. `second`: of a device opened with twice the width, beside the first;
  /// black without data. False: the kernel refused the buffer; errno holds the reason.
  bool write(const Frame& frame, const Frame& second = {}) noexcept;

 private:
  static constexpr unsigned kMostBuffers = 4;

  bool set_rate(double rate_hz) noexcept;
  Status fail(const std::string& device, const char* step);

  int fd_ = -1, width_ = 0, height_ = 0;
  std::array<void*, kMostBuffers> memory_{};
  unsigned count_ = 0, next_ = 0;
  std::size_t length_ = 0, stride_ = 0;
};

}  // namespace epiline
