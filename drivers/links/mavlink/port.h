#pragma once
// What MAVLink's bytes travel on.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "platform/error/device_trouble.h"

namespace epiline::mavlink {

struct PortResult {
  std::size_t bytes = 0;  ///< 0: nothing there, or no room now
  int error = 0;          ///< errno, where something was wrong
  bool is_lost = false;   ///< close it, and open it again later
};

/// Bytes to and from a peer. Nothing here waits or allocates. One thread.
class Port {
 public:
  Port() = default;
  virtual ~Port() = default;
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  virtual DeviceTrouble open() noexcept = 0;
  virtual void close() noexcept = 0;
  /// -1: not open.
  virtual int fd() const noexcept = 0;
  virtual PortResult read(std::span<std::uint8_t> into) noexcept = 0;
  /// May take a part only, where bytes are a stream; a datagram is whole.
  virtual PortResult write(std::span<const std::uint8_t> bytes) noexcept = 0;
  /// Bytes taken by write() that have not left yet; 0 where the system does not tell.
  virtual std::size_t backlog() const noexcept = 0;
  /// As the configuration names it.
  virtual const std::string& name() const noexcept = 0;
};

}  // namespace epiline::mavlink
