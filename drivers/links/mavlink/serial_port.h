#pragma once
// A serial port, or a pseudo terminal.
#include <string>

#include "drivers/links/mavlink/port.h"
#include "platform/linux/system_calls.h"

namespace epiline::mavlink {

/// Eight bits, no parity, no flow control, any rate that the driver supports. Opened exclusively.
class SerialPort final : public Port {
 public:
  SerialPort(std::string path, int baud, SystemCalls& system = SystemCalls::of_this_computer());
  ~SerialPort() override { close(); }

  DeviceTrouble open() noexcept override;
  void close() noexcept override;
  PortResult read(std::span<std::uint8_t> into) noexcept override;
  std::size_t backlog() const noexcept override;

 private:
  bool is_fatal(int /*error*/) const noexcept override { return true; }
  DeviceTrouble set_up() noexcept;

  int baud_ = 0;
};

}  // namespace epiline::mavlink
