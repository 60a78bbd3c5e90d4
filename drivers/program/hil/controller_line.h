#pragma once
// The controller's end of a line that carries MAVLink bytes.
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "platform/error/result.h"

namespace epiline::hil {

/// Bytes from and to the companion. No call blocks. One thread uses it.
class ControllerLine {
 public:
  virtual ~ControllerLine() = default;
  /// For poll(2).
  virtual int fd() const noexcept = 0;
  /// Reads the bytes that have arrived and returns their number; 0: none.
  virtual std::size_t read(std::span<std::uint8_t> into) noexcept = 0;
  /// Bytes that do not fit into the buffer are lost, as on a wire without a receiver.
  virtual void write(std::span<const std::uint8_t> bytes) noexcept = 0;
  /// The companion's end, as its configuration must name it: a device file, or ADDRESS:PORT.
  virtual const std::string& companion_end() const noexcept = 0;
};

/// A pair of pseudo terminals in raw mode. Both ends exist as long as the line does, so the companion may open and
/// close its end. `name`: path of a symbolic link to the companion's end; empty: no link. Fails if something exists at
/// that path, except a link that an earlier run left behind.
Result<std::unique_ptr<ControllerLine>> open_pty_line(const std::string& name = "");

/// A serial port of this computer that is wired to the companion's port.
Result<std::unique_ptr<ControllerLine>> open_serial_line(const std::string& device, int baud);

/// A UDP port of the loopback address; 0: any free one. The companion must send first, because its address is not
/// known.
Result<std::unique_ptr<ControllerLine>> open_udp_line(int port = 0);

}  // namespace epiline::hil
