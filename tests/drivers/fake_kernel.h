#pragma once
// A made-up kernel under drivers, for tests of one thread. Time goes on when the driver waits, and hardly otherwise, so
// that minutes of a flight take milliseconds, and a busy computer changes nothing.
#include <cerrno>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "platform/linux/system_calls.h"
#include "platform/memory/allocation_count.h"

namespace epiline::test {

inline constexpr std::int64_t kNever_ns = std::numeric_limits<std::int64_t>::max();
inline constexpr std::int64_t kMs = 1'000'000, kSecond_ns = 1'000 * kMs;

/// -1, and why.
inline int refuse(int error) {
  errno = error;
  return -1;
}

/// What is behind a file descriptor. Refuses everything until a device overrides it.
class FakeFile {
 public:
  virtual ~FakeFile() = default;
  /// Events of poll() that hold at this instant.
  virtual short ready(std::int64_t /*now_ns*/) { return 0; }
  /// When ready() may change by itself.
  virtual std::int64_t next_ns(std::int64_t /*now_ns*/) { return kNever_ns; }
  /// 0 or errno.
  virtual int opened() { return 0; }
  virtual void closed() {}
  virtual ssize_t read(void* /*into*/, std::size_t /*size*/) { return refuse(EINVAL); }
  virtual ssize_t write(const void* /*from*/, std::size_t /*size*/) { return refuse(EINVAL); }
  virtual int ioctl(unsigned long /*request*/, void* /*argument*/) { return refuse(ENOTTY); }
  virtual std::uint64_t number() { return 0; }  ///< of the device; 0: none
  virtual int flock(int /*operation*/) { return 0; }
  virtual void* map(std::size_t /*length*/, off_t /*offset*/) { return errno = ENODEV, reinterpret_cast<void*>(-1); }
  virtual int bind(const sockaddr* /*address*/, socklen_t /*length*/) { return 0; }
  virtual int connect(const sockaddr* /*address*/, socklen_t /*length*/) { return 0; }
  virtual int setsockopt(int /*level*/, int /*option*/, const void* /*value*/, socklen_t /*length*/) { return 0; }
};

class FakeEventFd final : public FakeFile {
 public:
  short ready(std::int64_t /*now_ns*/) override { return count_ > 0 ? POLLIN : 0; }
  ssize_t read(void* into, std::size_t size) override {
    if (count_ == 0) return refuse(EAGAIN);
    *static_cast<std::uint64_t*>(into) = std::exchange(count_, 0);
    return static_cast<ssize_t>(size);
  }
  ssize_t write(const void* from, std::size_t size) override {
    count_ += *static_cast<const std::uint64_t*>(from);
    return static_cast<ssize_t>(size);
  }

 private:
  std::uint64_t count_ = 0;
};

class FakeKernel final : public SystemCalls {
 public:
  using File = std::shared_ptr<FakeFile>;

  std::int64_t clock_ns = 5'000 * kSecond_ns;  ///< the computer has been on for a while
  std::int64_t horizon_ns = kNever_ns;         ///< no wait goes beyond: a signal interrupts it
  std::map<std::string, File> devices;         ///< by path
  /// Of socket(); null: errno says why not.
  std::function<File(int domain, int type, int protocol)> make_socket;
  std::function<Span(const void* memory)> read_time_of;  ///< none: 0.1 ms, whatever memory it is
  std::int64_t side_ns = 0;                              ///< what a side thread is woken for is done after this time
  bool is_beside = false;        ///< a side thread's work is under way: its time is not the driver's
  std::uint64_t heap_calls = 0;  ///< of this kernel, while the driver called it

  /// Something happens then, or as soon as somebody waits.
  void at(std::int64_t time_ns, std::function<void()> what) { plan_.emplace(time_ns, std::move(what)); }
  std::size_t open_files() const { return files_.size(); }
  /// A file that a device gives.
  int give(const File& file) { return add(file); }

  std::int64_t now_ns() noexcept override { return clock_ns += 1'000; }

  int wait(std::span<pollfd> files, Span at_most) noexcept override {
    const Scope scope(*this);
    const std::int64_t deadline_ns = at_most.ns > kNever_ns - clock_ns ? kNever_ns : clock_ns + at_most.ns;
    for (;;) {
      happen();
      int count = 0;
      std::int64_t next_ns = std::min(deadline_ns, plan_.empty() ? kNever_ns : plan_.begin()->first);
      for (pollfd& file : files) {
        file.revents = 0;
        FakeFile* const behind = find(file.fd);
        if (behind == nullptr) continue;
        file.revents = static_cast<short>(behind->ready(clock_ns) & (file.events | POLLERR | POLLHUP | POLLNVAL));
        count += file.revents != 0 ? 1 : 0;
        next_ns = std::min(next_ns, behind->next_ns(clock_ns));
      }
      if (count > 0 || clock_ns >= deadline_ns) return count;
      if (clock_ns >= horizon_ns) return refuse(EINTR);
      clock_ns = std::max(clock_ns + 1, std::min(next_ns, horizon_ns));
    }
  }

  int open(const char* path, int /*flags*/) noexcept override {
    const Scope scope(*this);
    const auto device = devices.find(path);
    if (device == devices.end()) return refuse(ENOENT);
    if (const int error = device->second->opened(); error != 0) return refuse(error);
    return add(device->second);
  }
  int close(int fd) noexcept override {
    const Scope scope(*this);
    const auto file = files_.find(fd);
    if (file == files_.end()) return refuse(EBADF);
    const File behind = file->second;
    files_.erase(file);
    behind->closed();
    return 0;
  }
  int duplicate(int fd) noexcept override {
    const Scope scope(*this);
    const auto file = files_.find(fd);
    return file == files_.end() ? refuse(EBADF) : add(File(file->second));
  }
  std::unique_ptr<SideThread> start_side_thread(const char* /*name*/, void (*work)(void*), void* context) override {
    return std::make_unique<FakeSideThread>(*this, work, context);
  }
  ssize_t read(int fd, void* into, std::size_t size) noexcept override {
    return ask(fd, [&](FakeFile& file) { return file.read(into, size); });
  }
  ssize_t write(int fd, const void* from, std::size_t size) noexcept override {
    return ask(fd, [&](FakeFile& file) { return file.write(from, size); });
  }
  int ioctl(int fd, unsigned long request, void* argument) noexcept override {
    return ask(fd, [&](FakeFile& file) { return file.ioctl(request, argument); });
  }
  std::uint64_t device_number(int fd) noexcept override {
    return ask(fd, [](FakeFile& file) { return static_cast<ssize_t>(file.number()); });
  }
  int flock(int fd, int operation) noexcept override {
    return ask(fd, [&](FakeFile& file) { return file.flock(operation); });
  }
  void* map(int fd, std::size_t length, off_t offset) noexcept override {
    const Scope scope(*this);
    FakeFile* const file = find(fd);
    if (file == nullptr) return errno = EBADF, reinterpret_cast<void*>(-1);
    void* const memory = file->map(length, offset);
    if (memory != reinterpret_cast<void*>(-1)) ++mappings;
    return memory;
  }
  int unmap(void* /*memory*/, std::size_t /*length*/) noexcept override {
    --mappings;
    return 0;
  }
  Span read_time(const void* memory, std::size_t /*length*/) noexcept override {
    return read_time_of ? read_time_of(memory) : Span{100'000};
  }
  int eventfd() noexcept override {
    const Scope scope(*this);
    return add(std::make_shared<FakeEventFd>());
  }
  int socket(int domain, int type, int protocol) noexcept override {
    const Scope scope(*this);
    errno = EAFNOSUPPORT;
    const File file = make_socket ? make_socket(domain, type, protocol) : nullptr;
    return file ? add(file) : -1;
  }
  int bind(int fd, const sockaddr* address, socklen_t length) noexcept override {
    return ask(fd, [&](FakeFile& file) { return file.bind(address, length); });
  }
  int connect(int fd, const sockaddr* address, socklen_t length) noexcept override {
    return ask(fd, [&](FakeFile& file) { return file.connect(address, length); });
  }
  int setsockopt(int fd, int level, int option, const void* value, socklen_t length) noexcept override {
    return ask(fd, [&](FakeFile& file) { return file.setsockopt(level, option, value, length); });
  }

  int mappings = 0;  ///< not undone

 private:
  /// What this kernel takes from the heap is not the driver's.
  class Scope {
   public:
    explicit Scope(FakeKernel& kernel) : kernel_(kernel) {}
    ~Scope() {
      const int error = errno;
      kernel_.heap_calls += heap_.calls();
      errno = error;
    }

   private:
    FakeKernel& kernel_;
    HeapCallScope heap_;
  };

  /// A thread of its own, but for the time: its work is done at one instant, side_ns after it was woken.
  class FakeSideThread final : public SideThread {
   public:
    FakeSideThread(FakeKernel& kernel, void (*work)(void*), void* context)
        : kernel_(kernel), work_(work), context_(context), woken_(std::make_shared<int>(0)) {}
    ~FakeSideThread() override {
      if (*woken_ > 0) run();
    }
    void wake() noexcept override {
      const Scope scope(kernel_);
      ++*woken_;
      kernel_.at(kernel_.clock_ns + kernel_.side_ns, [this, woken = std::weak_ptr<int>(woken_)] {
        if (!woken.expired()) run();
      });
    }

   private:
    void run() {
      *woken_ = 0;
      kernel_.is_beside = true;
      work_(context_);
      kernel_.is_beside = false;
    }

    FakeKernel& kernel_;
    void (*work_)(void*);
    void* context_;
    std::shared_ptr<int> woken_;  ///< times, not done yet
  };

  int add(const File& file) {
    files_[++last_fd_] = file;
    return last_fd_;
  }
  FakeFile* find(int fd) {
    const auto file = files_.find(fd);
    return file == files_.end() ? nullptr : file->second.get();
  }
  template <class Call>
  std::invoke_result_t<Call, FakeFile&> ask(int fd, Call call) {
    const Scope scope(*this);
    FakeFile* const file = find(fd);
    if (file == nullptr) return refuse(EBADF);
    return call(*file);
  }
  void happen() {
    while (!plan_.empty() && plan_.begin()->first <= clock_ns) {
      const std::function<void()> what = std::move(plan_.begin()->second);
      plan_.erase(plan_.begin());
      what();
    }
  }

  std::map<int, File> files_;
  std::multimap<std::int64_t, std::function<void()>> plan_;
  int last_fd_ = 1'000'000;  // none that this process really has
};

}  // namespace epiline::test
