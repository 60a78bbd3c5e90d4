#pragma once
// What Linux offers to threads that must be on time: priority, a processor of their own, memory that stays.
#include <pthread.h>

#include <cstdint>
#include <string>

namespace epiline {

struct ThreadSettings {
  const char* name = "";  ///< shown by `ps -L`, at most 15 characters
  int priority = 0;       ///< SCHED_FIFO 1 to 99; 0: the ordinary scheduler
  int cpu = -1;           ///< the only processor it runs on; -1: any
  std::size_t stack_bytes =
      1024 * 1024;  ///< all of it is touched before the thread's work begins; a guard page follows
};

/// What a thread asked for and did not get. Missing privileges are no failure: the thread runs all the same.
struct ThreadShortfall {
  bool priority = false, cpu = false;
};

/// What the current thread has cost so far, to be subtracted from a later reading.
struct ThreadCosts {
  std::uint64_t heap_calls = 0;
  std::uint64_t lock_calls = 0;
  std::uint64_t page_faults = 0;   ///< minor and major
  std::uint64_t switched_out = 0;  ///< preempted: lost the processor without having asked
  std::int64_t cpu_ns = 0;
};
ThreadCosts costs_of_this_thread() noexcept;
/// Processor time of the calling thread; it stands still while the thread waits. A system call: 0.4 us.
std::int64_t thread_cpu_ns() noexcept;
ThreadCosts operator-(const ThreadCosts& later, const ThreadCosts& earlier) noexcept;

/// A thread that is set up as asked before `body` runs in it. Joined by join() or the destructor; whoever owns it tells
/// the body to end.
class RealtimeThread {
 public:
  using Body = void (*)(void* context);

  RealtimeThread() = default;
  ~RealtimeThread() { join(); }
  RealtimeThread(const RealtimeThread&) = delete;
  RealtimeThread& operator=(const RealtimeThread&) = delete;

  /// False if and only if the system has no thread left.
  bool start(const ThreadSettings& settings, Body body, void* context);
  void join() noexcept;

  /// Valid once the body runs.
  const ThreadShortfall& shortfall() const noexcept { return shortfall_; }
  /// Size of the stack, and how much of it was ever used: by the body, and by the C library before it. After join().
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

/// Keeps all memory of the process, present and future, in physical memory, and freed memory in the process. Empty if
/// it worked, otherwise why not. Not attempted where a limit would make later allocations fail.
std::string lock_memory();

/// The most physical memory that the process has had so far.
double peak_rss_mib();

}  // namespace epiline
