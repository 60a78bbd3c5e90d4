#pragma once
// The controller's end of a line that carries MAVLink bytes.
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "platform/error/result.h"

namespace epiline::hil {

/// Bytes from and to the companion. Nothing waits. One thread.
class ControllerLine {
 public:
  virtual ~ControllerLine() = default;
  /// To wait on.
  virtual int fd() const noexcept = 0;
  /// Bytes that have come; 0: none.
  virtual std::size_t read(std::span<std::uint8_t> into) noexcept = 0;
  /// What finds no room is lost, as on a wire nobody listens to.
  virtual void write(std::span<const std::uint8_t> bytes) noexcept = 0;
  /// What the companion's configuration has to name: a device file, or ADDRESS:PORT.
  virtual const std::string& companion_end() const noexcept = 0;
};

/// A pair of pseudo terminals, raw. Both ends exist as long as the line does, so the companion may come and go. `name`:
/// a path at which the companion finds its end meanwhile; what is there already is an error, but for such a link that
/// was left behind.
Result<std::unique_ptr<ControllerLine>> open_pty_line(const std::string& name = "");

/// A serial port of this computer, whose other end is wired to the companion's port.
Result<std::unique_ptr<ControllerLine>> open_serial_line(const std::string& device, int baud);

/// A port of the loopback address; 0: any. The companion speaks first.
Result<std::unique_ptr<ControllerLine>> open_udp_line(int port = 0);

}  // namespace epiline::hil
