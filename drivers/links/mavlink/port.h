#pragma once
// What MAVLink's bytes travel on.
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "platform/error/device_trouble.h"
#include "platform/linux/system_calls.h"

namespace epiline::mavlink {

struct PortResult {
  std::size_t bytes = 0;  ///< 0: nothing there, or no room now
  int error = 0;          ///< errno, where something was wrong
  bool is_lost = false;   ///< close it, and open it again later
};

/// Bytes to and from a peer. Nothing here waits or allocates. One thread.
class Port {
 public:
  /// `name`: as the configuration names it.
  Port(std::string name, SystemCalls& system) : name_(std::move(name)), system_(system) {}
  virtual ~Port() = default;
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  virtual DeviceTrouble open() noexcept = 0;
  virtual void close() noexcept = 0;
  /// -1: not open.
  int fd() const noexcept { return fd_; }
  virtual PortResult read(std::span<std::uint8_t> into) noexcept {
    return result_of(system_.read(fd_, into.data(), into.size()));
  }
  /// May take a part only, where bytes are a stream; a datagram is whole.
  PortResult write(std::span<const std::uint8_t> bytes) noexcept {
    return result_of(system_.write(fd_, bytes.data(), bytes.size()));
  }
  /// Bytes taken by write() that have not left yet; 0 where the system does not tell.
  virtual std::size_t backlog() const noexcept { return 0; }
  const std::string& name() const noexcept { return name_; }

 protected:
  /// Whether it has to be opened anew after that error.
  virtual bool is_fatal(int error) const noexcept = 0;
  /// Of read() or write() that returned `count`.
  PortResult result_of(ssize_t count) const noexcept {
    if (count >= 0) return {static_cast<std::size_t>(count), 0, false};
    const int error = errno;
    return error == EAGAIN || error == EINTR ? PortResult{} : PortResult{0, error, is_fatal(error)};
  }

  std::string name_;
  SystemCalls& system_;
  int fd_ = -1;
};

}  // namespace epiline::mavlink
