#include "drivers/program/hil/controller_line.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "drivers/links/mavlink/serial_port.h"
#include "platform/error/device_trouble.h"

namespace epiline::hil {

namespace {

Error failed(const std::string& what, const char* step) {
  return {ErrorKind::kRun, what, 0, std::string(step) + ": " + std::generic_category().message(errno), ""};
}

class File {
 public:
  explicit File(int fd = -1) : fd_(fd) {}
  File(File&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  File& operator=(File&&) = delete;
  ~File() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

/// A symbolic link, removed in the end.
class Link {
 public:
  explicit Link(std::string path = "") : path_(std::move(path)) {}
  Link(Link&& other) noexcept : path_(std::exchange(other.path_, "")) {}
  Link& operator=(Link&&) = delete;
  ~Link() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }

 private:
  std::string path_;
};

/// True for a link that a killed run of this program left behind. Any other link may belong to the user.
bool is_left_behind(const std::string& path) {
  std::error_code ignored;
  const std::string target = std::filesystem::read_symlink(path, ignored).string();
  return target.rfind("/dev/pts/", 0) == 0;
}

/// A pseudo terminal.
class Terminal final : public ControllerLine {
 public:
  /// `other`: of a pair, kept open.
  Terminal(File file, File other, std::string companion_end, Link link = Link())
      : file_(std::move(file)),
        other_(std::move(other)),
        companion_end_(std::move(companion_end)),
        link_(std::move(link)) {}
  int fd() const noexcept override { return file_.get(); }
  std::size_t read(std::span<std::uint8_t> into) noexcept override {
    const ssize_t got = ::read(file_.get(), into.data(), into.size());
    return got > 0 ? static_cast<std::size_t>(got) : 0;
  }
  void write(std::span<const std::uint8_t> bytes) noexcept override {
    [[maybe_unused]] const ssize_t sent = ::write(file_.get(), bytes.data(), bytes.size());
  }
  const std::string& companion_end() const noexcept override { return companion_end_; }

 private:
  File file_, other_;
  std::string companion_end_;
  Link link_;
};

/// A serial port of this computer.
class Wire final : public ControllerLine {
 public:
  explicit Wire(std::unique_ptr<mavlink::SerialPort> port) : port_(std::move(port)) {}
  int fd() const noexcept override { return port_->fd(); }
  std::size_t read(std::span<std::uint8_t> into) noexcept override { return port_->read(into).bytes; }
  void write(std::span<const std::uint8_t> bytes) noexcept override { port_->write(bytes); }
  const std::string& companion_end() const noexcept override { return unknown_; }

 private:
  std::unique_ptr<mavlink::SerialPort> port_;
  std::string unknown_;  ///< whatever is wired to it
};

class Datagrams final : public ControllerLine {
 public:
  Datagrams(File socket, std::string companion_end)
      : socket_(std::move(socket)), companion_end_(std::move(companion_end)) {}
  int fd() const noexcept override { return socket_.get(); }
  std::size_t read(std::span<std::uint8_t> into) noexcept override {
    sockaddr_in from{};
    socklen_t size = sizeof from;
    const ssize_t got =
        ::recvfrom(socket_.get(), into.data(), into.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
    if (got <= 0) return 0;
    if (!companion_) companion_ = from;  // the first who speaks
    return static_cast<std::size_t>(got);
  }
  void write(std::span<const std::uint8_t> bytes) noexcept override {
    if (!companion_) return;
    ::sendto(socket_.get(), bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&*companion_),
             sizeof *companion_);
  }
  const std::string& companion_end() const noexcept override { return companion_end_; }

 private:
  File socket_;
  std::string companion_end_;
  std::optional<sockaddr_in> companion_;
};

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

Result<std::unique_ptr<ControllerLine>> open_pty_line(const std::string& name) {
  File controller(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK));
  if (controller.get() < 0 || ::grantpt(controller.get()) != 0 || ::unlockpt(controller.get()) != 0)
    return failed("pty", "no pseudo terminal");
  std::array<char, 128> pts{};
  if (::ptsname_r(controller.get(), pts.data(), pts.size()) != 0) return failed("pty", "no name");
  File companion(::open(pts.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  if (companion.get() < 0 || !set_raw(companion.get())) return failed(pts.data(), "cannot be made raw");
  if (!name.empty()) {
    if (is_left_behind(name)) ::unlink(name.c_str());
    if (::symlink(pts.data(), name.c_str()) != 0) {
      Error error = failed(name, "cannot be made a name of the pseudo terminal");
      error.kind = ErrorKind::kUsage;
      error.expected = "an unused path in a writable folder";
      return error;
    }
  }
  const std::string companion_end = name.empty() ? pts.data() : name;
  return std::unique_ptr<ControllerLine>(
      std::make_unique<Terminal>(std::move(controller), std::move(companion), companion_end, Link(name)));
}

Result<std::unique_ptr<ControllerLine>> open_serial_line(const std::string& device, int baud) {
  auto port = std::make_unique<mavlink::SerialPort>(device, baud);
  if (const DeviceTrouble trouble = port->open()) {
    Error error = error_of(trouble, device);
    error.kind = ErrorKind::kUsage;
    error.expected += " that is wired to the configured one, or pty, udp or a CAN interface";
    return error;
  }
  return std::unique_ptr<ControllerLine>(std::make_unique<Wire>(std::move(port)));
}

Result<std::unique_ptr<ControllerLine>> open_udp_line(int port) {
  File socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  own.sin_port = htons(static_cast<std::uint16_t>(port));
  socklen_t size = sizeof own;
  if (socket.get() < 0 || ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&own), size) != 0 ||
      ::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&own), &size) != 0)
    return failed("127.0.0.1:" + std::to_string(port), "no port");
  return std::unique_ptr<ControllerLine>(
      std::make_unique<Datagrams>(std::move(socket), "127.0.0.1:" + std::to_string(ntohs(own.sin_port))));
}

}  // namespace epiline::hil
