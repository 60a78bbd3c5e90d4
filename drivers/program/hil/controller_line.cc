#include "drivers/program/hil/controller_line.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "platform/error/device_trouble.h"

namespace epiline::hil {

namespace {

/// With errno. With an `expected`, the user can do something about it.
Error failed(const std::string& what, const char* step, const char* expected = "") {
  const bool is_usage = *expected != '\0';
  return {is_usage ? ErrorKind::kUsage : ErrorKind::kRun, what, 0,
          std::string(step) + ": " + std::generic_category().message(errno), expected};
}

/// True for a link that a killed run of this program left behind. Any other link may belong to the user.
bool is_left_behind(const std::string& path) {
  std::error_code ignored;
  const std::string target = std::filesystem::read_symlink(path, ignored).string();
  return target.rfind("/dev/pts/", 0) == 0;
}

/// Bytes as they are. False: errno.
bool set_raw(int fd) {
  termios t{};
  if (::tcgetattr(fd, &t) != 0) return false;
  ::cfmakeraw(&t);
  t.c_cflag |= CLOCAL | CREAD;
  t.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS);
  return ::tcsetattr(fd, TCSANOW, &t) == 0;
}

}  // namespace

ControllerLine::~ControllerLine() {
  if (!link_.empty()) ::unlink(link_.c_str());
  if (companion_fd_ >= 0) ::close(companion_fd_);
  if (fd_ >= 0 && !port_) ::close(fd_);
}

std::size_t ControllerLine::read(std::span<std::uint8_t> into) noexcept {
  sockaddr_in from{};
  socklen_t size = sizeof from;
  const ssize_t got = is_udp_ ? ::recvfrom(fd_, into.data(), into.size(), 0, reinterpret_cast<sockaddr*>(&from), &size)
                              : ::read(fd_, into.data(), into.size());
  if (got <= 0) return 0;
  if (is_udp_ && !companion_) companion_ = from;
  return static_cast<std::size_t>(got);
}

void ControllerLine::write(std::span<const std::uint8_t> bytes) noexcept {
  if (!is_udp_) {
    [[maybe_unused]] const ssize_t sent = ::write(fd_, bytes.data(), bytes.size());
  } else if (companion_) {
    ::sendto(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&*companion_), sizeof *companion_);
  }
}

Result<std::unique_ptr<ControllerLine>> ControllerLine::open_pty(const std::string& name) {
  std::unique_ptr<ControllerLine> line(new ControllerLine);
  line->fd_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (line->fd_ < 0 || ::grantpt(line->fd_) != 0 || ::unlockpt(line->fd_) != 0)
    return failed("pty", "no pseudo terminal");
  std::array<char, 128> pts{};
  if (::ptsname_r(line->fd_, pts.data(), pts.size()) != 0) return failed("pty", "no name");
  line->companion_fd_ = ::open(pts.data(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (line->companion_fd_ < 0 || !set_raw(line->companion_fd_)) return failed(pts.data(), "cannot be made raw");
  if (!name.empty()) {
    if (is_left_behind(name)) ::unlink(name.c_str());
    if (::symlink(pts.data(), name.c_str()) != 0)
      return failed(name, "cannot be made a name of the pseudo terminal", "an unused path in a writable folder");
    line->link_ = name;
  }
  line->companion_end_ = name.empty() ? pts.data() : name;
  return line;
}

Result<std::unique_ptr<ControllerLine>> ControllerLine::open_serial(const std::string& device, int baud) {
  std::unique_ptr<ControllerLine> line(new ControllerLine);
  line->port_ = std::make_unique<mavlink::SerialPort>(device, baud);
  if (const DeviceTrouble trouble = line->port_->open()) {
    Error error = error_of(trouble, device);
    error.kind = ErrorKind::kUsage;
    error.expected += " that is wired to the configured one, or pty, udp or a CAN interface";
    return error;
  }
  line->fd_ = line->port_->fd();
  return line;
}

Result<std::unique_ptr<ControllerLine>> ControllerLine::open_udp(int port) {
  std::unique_ptr<ControllerLine> line(new ControllerLine);
  line->is_udp_ = true;
  line->fd_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  own.sin_port = htons(static_cast<std::uint16_t>(port));
  socklen_t size = sizeof own;
  if (line->fd_ < 0 || ::bind(line->fd_, reinterpret_cast<const sockaddr*>(&own), size) != 0 ||
      ::getsockname(line->fd_, reinterpret_cast<sockaddr*>(&own), &size) != 0)
    return failed("127.0.0.1:" + std::to_string(port), "no port");
  line->companion_end_ = "127.0.0.1:" + std::to_string(ntohs(own.sin_port));
  return line;
}

Result<std::unique_ptr<ControllerLine>> ControllerLine::open_can(const std::string& interface) {
  constexpr const char* kExpected =
      "a CAN interface that is up (ip link add vcan0 type vcan; ip link set vcan0 mtu 72 up)";
  std::unique_ptr<ControllerLine> line(new ControllerLine);
  line->fd_ = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
  if (line->fd_ < 0) return failed(interface, "the kernel has no CAN support", kExpected);
  const int both = 1;
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  if (address.can_ifindex == 0) return failed(interface, "no such network interface", kExpected);
  if (::setsockopt(line->fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &both, sizeof both) != 0 ||
      ::bind(line->fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return failed(interface, "cannot listen on it", kExpected);
  return line;
}

}  // namespace epiline::hil
