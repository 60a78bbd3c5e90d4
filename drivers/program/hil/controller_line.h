#pragma once
// The controller's end of a line that carries MAVLink bytes, or of a CAN bus.
#include <netinet/in.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "drivers/links/mavlink/serial_port.h"
#include "platform/error/result.h"

namespace epiline::hil {

/// Bytes from and to the companion. No call blocks. One thread uses it.
class ControllerLine {
 public:
  /// A pair of pseudo terminals in raw mode. Both ends exist as long as the line does, so the companion may open and
  /// close its end. `name`: path of a symbolic link to the companion's end; empty: no link. Fails if something exists
  /// at that path, except a link that an earlier run left behind.
  static Result<std::unique_ptr<ControllerLine>> open_pty(const std::string& name = "");
  /// A serial port of this computer that is wired to the companion's port.
  static Result<std::unique_ptr<ControllerLine>> open_serial(const std::string& device, int baud);
  /// A UDP port of the loopback address; 0: any free one. The companion must send first, because its address is not
  /// known.
  static Result<std::unique_ptr<ControllerLine>> open_udp(int port = 0);
  /// All frames of a CAN interface, classic and FD. Each read() gives one frame, a `canfd_frame` of the kernel.
  static Result<std::unique_ptr<ControllerLine>> open_can(const std::string& interface);

  ~ControllerLine();
  ControllerLine(const ControllerLine&) = delete;
  ControllerLine& operator=(const ControllerLine&) = delete;

  /// For poll(2).
  int fd() const noexcept { return fd_; }
  /// Reads the bytes that have arrived and returns their number; 0: none.
  std::size_t read(std::span<std::uint8_t> into) noexcept;
  /// Bytes that do not fit into the buffer are lost, as on a wire without a receiver.
  void write(std::span<const std::uint8_t> bytes) noexcept;
  /// The companion's end, as its configuration must name it: a device file, or ADDRESS:PORT. Empty: whatever is wired
  /// to the line.
  const std::string& companion_end() const noexcept { return companion_end_; }

 private:
  ControllerLine() = default;

  int fd_ = -1, companion_fd_ = -1;  ///< the second: of a pair of pseudo terminals, kept open
  std::string companion_end_, link_;
  std::unique_ptr<mavlink::SerialPort> port_;  ///< owns `fd_` of a serial line
  bool is_udp_ = false;
  std::optional<sockaddr_in> companion_;  ///< of UDP: the first that has sent
};

}  // namespace epiline::hil
