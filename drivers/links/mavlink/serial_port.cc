#include "drivers/links/mavlink/serial_port.h"

// the kernel's termios: the C library's has no speeds but the traditional ones
#include <asm/termbits.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>

#include <cerrno>
#include <cstdlib>
#include <utility>

namespace epiline::mavlink {

namespace {

/// Drivers round to what their clock can divide. A receiver bears some 2 % in all.
bool is_near(unsigned found, int wanted) noexcept {
  return std::abs(static_cast<double>(found) - wanted) <= 0.015 * wanted;
}

/// Of a request that takes a number.
void* as_argument(std::uintptr_t number) noexcept { return reinterpret_cast<void*>(number); }

/// Some drivers wait up to 16 ms for more bytes unless told not to. Many know nothing of it, and need not.
void ask_for_low_latency(SystemCalls& system, int fd) noexcept {
  serial_struct settings{};
  if (system.ioctl(fd, TIOCGSERIAL, &settings) != 0) return;
  settings.flags |= ASYNC_LOW_LATENCY;
  system.ioctl(fd, TIOCSSERIAL, &settings);
}

}  // namespace

SerialPort::SerialPort(std::string path, int baud, SystemCalls& system) : Port(std::move(path), system), baud_(baud) {}

DeviceTrouble SerialPort::open() noexcept {
  close();
  // without O_NONBLOCK the driver may wait for a carrier
  fd_ = system_.open(name_.c_str(), O_RDWR | O_NOCTTY);
  if (fd_ < 0) {
    const int error = errno;
    if (error == EACCES) return device_refusal("open", error, "permission: join the device's group, often dialout");
    if (error == EBUSY) return device_refusal("open", error, "a port that no other program has open (ModemManager?)");
    return device_refusal("open", error, "a connected serial device (epiline devices lists them)");
  }
  const DeviceTrouble trouble = set_up();
  if (trouble) close();
  return trouble;
}

DeviceTrouble SerialPort::set_up() noexcept {
  termios2 line{};
  if (system_.ioctl(fd_, TCGETS2, &line) != 0) return device_refusal("TCGETS2", errno, "a serial device");
  // root may open what is exclusive, so both
  if (system_.flock(fd_, LOCK_EX | LOCK_NB) != 0 || system_.ioctl(fd_, TIOCEXCL, nullptr) != 0)
    return device_refusal("exclusive access", errno, "a port that no other program has open (ModemManager?)");
  line.c_iflag = 0;
  line.c_oflag = 0;
  line.c_lflag = 0;
  line.c_cflag = CS8 | CREAD | CLOCAL | BOTHER;
  line.c_cc[VMIN] = 1;  // so that a read of nothing is an error of its own, and 0 means hung up
  line.c_cc[VTIME] = 0;
  line.c_ispeed = line.c_ospeed = static_cast<speed_t>(baud_);
  if (system_.ioctl(fd_, TCSETS2, &line) != 0)
    return device_refusal("TCSETS2", errno, "a baud rate in mavlink.baud that the port has");
  if (system_.ioctl(fd_, TCGETS2, &line) != 0 || !is_near(line.c_ospeed, baud_))
    return device_refusal("the port chose another baud rate", 0, "one in mavlink.baud that it has");
  ask_for_low_latency(system_, fd_);
  system_.ioctl(fd_, TCFLSH, as_argument(TCIOFLUSH));  // what waited there is old
  return {};
}

void SerialPort::close() noexcept {
  if (fd_ < 0) return;
  if (backlog() > 0)
    system_.ioctl(fd_, TCFLSH, as_argument(TCOFLUSH));  // else closing waits up to 30 s for a line that takes nothing
  system_.ioctl(fd_, TIOCNXCL, nullptr);
  system_.close(fd_);
  fd_ = -1;
}

PortResult SerialPort::read(std::span<std::uint8_t> into) noexcept {
  const ssize_t count = system_.read(fd_, into.data(), into.size());
  return count == 0 ? PortResult{0, EIO, true} : result_of(count);
}

std::size_t SerialPort::backlog() const noexcept {
  int count = 0;
  return system_.ioctl(fd_, TIOCOUTQ, &count) == 0 && count > 0 ? static_cast<std::size_t>(count) : 0;
}

}  // namespace epiline::mavlink
