#include "platform/linux/system_calls.h"

#include <fcntl.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <limits>

#include "platform/time/monotonic.h"
#include "platform/time/sleep.h"

namespace epiline {

SystemCalls& SystemCalls::of_this_computer() noexcept {
  static SystemCalls kernel;
  return kernel;
}

std::int64_t SystemCalls::now_ns() noexcept { return monotonic_ns(); }

int SystemCalls::wait(std::span<pollfd> files, Span at_most) noexcept {
  const timespec time = timespec_of(std::max<std::int64_t>(at_most.ns, 0));
  return ::ppoll(files.data(), files.size(), &time, nullptr);
}

int SystemCalls::open(const char* path, int flags) noexcept { return ::open(path, flags | O_NONBLOCK | O_CLOEXEC); }
int SystemCalls::close(int fd) noexcept { return ::close(fd); }
int SystemCalls::duplicate(int fd) noexcept { return ::fcntl(fd, F_DUPFD_CLOEXEC, 0); }
ssize_t SystemCalls::read(int fd, void* into, std::size_t size) noexcept { return ::read(fd, into, size); }
ssize_t SystemCalls::write(int fd, const void* from, std::size_t size) noexcept { return ::write(fd, from, size); }
int SystemCalls::ioctl(int fd, unsigned long request, void* argument) noexcept {
  return ::ioctl(fd, request, argument);
}
std::uint64_t SystemCalls::device_number(int fd) noexcept {
  struct stat status {};
  return ::fstat(fd, &status) == 0 ? status.st_rdev : 0;
}
int SystemCalls::flock(int fd, int operation) noexcept { return ::flock(fd, operation); }
void* SystemCalls::map(int fd, std::size_t length, off_t offset) noexcept {
  return ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd, offset);
}
int SystemCalls::unmap(void* memory, std::size_t length) noexcept { return ::munmap(memory, length); }
Span SystemCalls::read_time(const void* memory, std::size_t length) noexcept {
  constexpr int kTimes = 5;
  const auto* const words = static_cast<const volatile std::uint64_t*>(memory);
  Span shortest{std::numeric_limits<std::int64_t>::max()};
  for (int i = 0; i < kTimes; ++i) {
    const std::int64_t begin_ns = now_ns();
    for (std::size_t k = 0; k < length / sizeof(std::uint64_t); ++k) static_cast<void>(words[k]);
    shortest = std::min(shortest, Span{now_ns() - begin_ns});
  }
  return shortest;
}
int SystemCalls::eventfd() noexcept { return ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC); }

int SystemCalls::socket(int domain, int type, int protocol) noexcept {
  return ::socket(domain, type | SOCK_NONBLOCK | SOCK_CLOEXEC, protocol);
}
int SystemCalls::bind(int fd, const sockaddr* address, socklen_t length) noexcept {
  return ::bind(fd, address, length);
}
int SystemCalls::connect(int fd, const sockaddr* address, socklen_t length) noexcept {
  return ::connect(fd, address, length);
}
int SystemCalls::setsockopt(int fd, int level, int option, const void* value, socklen_t length) noexcept {
  return ::setsockopt(fd, level, option, value, length);
}
std::unique_ptr<SideThread> SystemCalls::start_side_thread(const char* name, void (*work)(void*), void* context) {
  return epiline::start_side_thread(name, work, context);
}

// ---- waking ----

bool WakeUp::open() noexcept {
  fd_ = system_.eventfd();
  return fd_ >= 0;
}

void WakeUp::close() noexcept {
  if (fd_ >= 0) system_.close(fd_);
  fd_ = -1;
}

void WakeUp::notify() noexcept {
  const std::uint64_t one = 1;
  // fails only if the counter is full of wake-ups nobody has looked at
  [[maybe_unused]] const ssize_t written = system_.write(fd_, &one, sizeof one);
}

void WakeUp::clear() noexcept {
  std::uint64_t times = 0;
  [[maybe_unused]] const ssize_t got = system_.read(fd_, &times, sizeof times);
}

}  // namespace epiline
