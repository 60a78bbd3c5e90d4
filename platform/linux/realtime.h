#pragma once
// Real-time properties of Linux threads: priority, processor, locked memory, and what a thread has cost.
#include <pthread.h>

#include <cstdint>
#include <string>

namespace epiline {

struct ThreadSettings {
  const char* name = "";  ///< shown by `ps -L`, at most 15 characters
  int priority = 0;       ///< SCHED_FIFO 1 to 99; 0: the ordinary scheduler
  int cpu = -1;           ///< the only processor it runs on; -1: any
  std::size_t stack_bytes =
      1024 * 1024;  ///< stack size in bytes; all of it is touched before the body runs, and a guard page follows
};

/// Requested properties that were not granted. Missing privileges are not an error: the thread runs without them.
struct ThreadShortfall {
  bool priority = false, cpu = false;
};

/// Costs of the current thread since it started; subtract an earlier value from a later one.
struct ThreadCosts {
  std::uint64_t heap_calls = 0;
  std::uint64_t lock_calls = 0;
  std::uint64_t page_faults = 0;   ///< minor and major
  std::uint64_t switched_out = 0;  ///< times the thread was preempted
  std::int64_t cpu_ns = 0;
};
ThreadCosts costs_of_this_thread() noexcept;
/// Processor time of the calling thread, ns; it does not advance while the thread waits. One system call, 0.4 us.
std::int64_t thread_cpu_ns() noexcept;
ThreadCosts operator-(const ThreadCosts& later, const ThreadCosts& earlier) noexcept;

/// A thread with the given properties, set before `body` runs. join() or the destructor joins it; the owner must first
/// make the body end.
class RealtimeThread {
 public:
  using Body = void (*)(void* context);

  RealtimeThread() = default;
  ~RealtimeThread() { join(); }
  RealtimeThread(const RealtimeThread&) = delete;
  RealtimeThread& operator=(const RealtimeThread&) = delete;

  /// False if and only if the system cannot start a thread.
  bool start(const ThreadSettings& settings, Body body, void* context);
  void join() noexcept;

  /// Valid once the body runs.
  const ThreadShortfall& shortfall() const noexcept { return shortfall_; }
  /// Size of the stack, and the largest part of it used by the body and the C library before it. After join().
  std::size_t stack_bytes() const noexcept { return stack_bytes_; }
  std::size_t stack_used() const noexcept { return stack_used_; }

 private:
  static void* run(void* self);

  ThreadSettings settings_;
  Body body_ = nullptr;
  void* context_ = nullptr;
  pthread_t thread_{};
  bool running_ = false;
  ThreadShortfall shortfall_;
  std::size_t stack_bytes_ = 0, stack_used_ = 0;
};

/// Locks all present and future memory of the process, keeps freed memory in the process, and keeps the kernel from
/// joining its pages to huge ones. Returns an empty text on success, otherwise the reason. Not attempted if a limit
/// would make later allocations fail.
std::string lock_memory();

/// Largest resident memory of the process so far.
double peak_rss_mib();

}  // namespace epiline
