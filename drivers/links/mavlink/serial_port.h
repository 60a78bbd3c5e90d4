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
  int fd() const noexcept override { return fd_; }
  PortResult read(std::span<std::uint8_t> into) noexcept override;
  PortResult write(std::span<const std::uint8_t> bytes) noexcept override;
  std::size_t backlog() const noexcept override;
  const std::string& name() const noexcept override { return path_; }

 private:
  DeviceTrouble set_up() noexcept;

  std::string path_;
  int baud_ = 0;
  SystemCalls& system_;
  int fd_ = -1;
};

}  // namespace epiline::mavlink
