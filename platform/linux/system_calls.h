#pragma once
// What drivers ask of the kernel, and the clock they wait by. Tests bring a kernel of their own, so that none of them
// depends on how busy the computer is.
#include <poll.h>
#include <sys/socket.h>
#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "platform/linux/side_thread.h"
#include "platform/time/clock.h"

namespace epiline {

/// As the manual pages of section 2 say, errno included. Files are opened close-on-exec and non-blocking.
class SystemCalls {
 public:
  virtual ~SystemCalls() = default;
  /// The kernel this program runs on.
  static SystemCalls& of_this_computer() noexcept;

  /// CLOCK_MONOTONIC.
  virtual std::int64_t now_ns() noexcept;
  /// ppoll(): until a file is ready, a signal comes, or the time is over.
  virtual int wait(std::span<pollfd> files, Span at_most) noexcept;

  virtual int open(const char* path, int flags) noexcept;
  virtual int close(int fd) noexcept;
  /// Another descriptor of the same open file, close-on-exec.
  virtual int duplicate(int fd) noexcept;
  virtual ssize_t read(int fd, void* into, std::size_t size) noexcept;
  virtual ssize_t write(int fd, const void* from, std::size_t size) noexcept;
  virtual int ioctl(int fd, unsigned long request, void* argument) noexcept;
  /// fstat()'s st_rdev; 0: none.
  virtual std::uint64_t device_number(int fd) noexcept;
  virtual int flock(int fd, int operation) noexcept;
  /// mmap() of a device's memory, shared, for reading and writing, and with its pages present.
  virtual void* map(int fd, std::size_t length, off_t offset) noexcept;
  virtual int unmap(void* memory, std::size_t length) noexcept;
  /// The time that reading this memory once takes: the shortest of some.
  virtual Span read_time(const void* memory, std::size_t length) noexcept;
  virtual int eventfd() noexcept;

  virtual int socket(int domain, int type, int protocol) noexcept;
  virtual int bind(int fd, const sockaddr* address, socklen_t length) noexcept;
  virtual int connect(int fd, const sockaddr* address, socklen_t length) noexcept;
  virtual int setsockopt(int fd, int level, int option, const void* value, socklen_t length) noexcept;

  /// As epiline::start_side_thread().
  virtual std::unique_ptr<SideThread> start_side_thread(const char* name, void (*work)(void* context), void* context);
};

/// Wakes a thread that waits in SystemCalls::wait() with our fd() among its files.
class WakeUp {
 public:
  explicit WakeUp(SystemCalls& system) noexcept : system_(system) {}
  ~WakeUp() { close(); }
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;

  /// False: errno says why not.
  bool open() noexcept;
  void close() noexcept;
  bool is_open() const noexcept { return fd_ >= 0; }
  int fd() const noexcept { return fd_; }
  /// Any thread.
  void notify() noexcept;
  /// The thread that was woken: the next wait sleeps again.
  void clear() noexcept;

 private:
  SystemCalls& system_;
  int fd_ = -1;
};

}  // namespace epiline
