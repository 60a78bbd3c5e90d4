#pragma once
// The writing end of a v4l2loopback device: what is written comes out of the device as a camera's images.
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

/// 8-bit grey images. One thread.
class LoopbackWriter {
 public:
  LoopbackWriter() = default;
  ~LoopbackWriter() { close(); }
  LoopbackWriter(const LoopbackWriter&) = delete;
  LoopbackWriter& operator=(const LoopbackWriter&) = delete;

  /// Sets the device's format and what it says of its rate (0: nothing); readers can open it from then on.
  Status open(const std::string& device, int width, int height, double rate_hz = 0);
  void close() noexcept;
  /// The reader gets the stamp as it is, to the microsecond. `bytes`: what is said to be in the buffer, for tests of
  /// short images; 0: all of it. False: the kernel refused; errno says why.
  bool write(const Frame& frame, std::size_t bytes = 0) noexcept;

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
