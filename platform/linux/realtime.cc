#include "platform/linux/realtime.h"

#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "platform/memory/sanitizers.h"

namespace epiline {

namespace {

#if defined(EPILINE_UNDER_SANITIZER) || !defined(__OPTIMIZE__)  // frames are several times as large
constexpr std::size_t kFrameGrowth = 8;
#else
constexpr std::size_t kFrameGrowth = 1;
#endif
constexpr std::size_t kPage = 4096;

/// The unused part of a thread's stack: from its lowest address up to near the current frame.
struct FreeStack {
  volatile std::uint64_t* begin = nullptr;
  volatile std::uint64_t* end = nullptr;
  std::uintptr_t top = 0;  ///< highest address of the stack
};

FreeStack free_stack() {
  pthread_attr_t attributes;
  void* lowest = nullptr;
  std::size_t bytes = 0;
  if (pthread_getattr_np(pthread_self(), &attributes) != 0) return {};
  pthread_attr_getstack(&attributes, &lowest, &bytes);
  pthread_attr_destroy(&attributes);
  const auto begin = reinterpret_cast<std::uintptr_t>(lowest);
  const auto here = reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0)) & ~(kPage - 1);
  return {reinterpret_cast<std::uint64_t*>(begin), reinterpret_cast<std::uint64_t*>(std::max(here - kPage, begin)),
          begin + bytes};
}

constexpr std::uint64_t kUntouched = 0xA5A5A5A5A5A5A5A5;

/// Writes to every page below, so that none has to be found later, and leaves marks for used_of().
__attribute__((noinline, no_sanitize("address", "thread"))) void paint(const FreeStack& stack) {
  for (volatile std::uint64_t* word = stack.begin; word < stack.end; ++word) *word = kUntouched;
}

/// How deep the stack was at its deepest, by the lowest mark that is gone.
__attribute__((noinline, no_sanitize("address", "thread"))) std::size_t used_of(const FreeStack& stack) {
  volatile std::uint64_t* word = stack.begin;
  while (word < stack.end && *word == kUntouched) ++word;
  return stack.top - reinterpret_cast<std::uintptr_t>(word);
}

bool set_priority(int priority) {
  if (priority <= 0) return true;
  const sched_param parameter{priority};
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0;
}

bool set_cpu(int cpu) {
  if (cpu < 0) return true;
  cpu_set_t set;
  CPU_ZERO(&set);
  if (cpu < CPU_SETSIZE) CPU_SET(static_cast<std::size_t>(cpu), &set);
  return pthread_setaffinity_np(pthread_self(), sizeof set, &set) == 0;
}

}  // namespace

std::int64_t thread_cpu_ns() noexcept {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return time.tv_sec * 1'000'000'000LL + time.tv_nsec;
}

ThreadCosts costs_of_this_thread() noexcept {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return {heap_calls_of_this_thread(), lock_calls_of_this_thread(),
          static_cast<std::uint64_t>(usage.ru_minflt + usage.ru_majflt), static_cast<std::uint64_t>(usage.ru_nivcsw),
          thread_cpu_ns()};
}

ThreadCosts operator-(const ThreadCosts& later, const ThreadCosts& earlier) noexcept {
  return {later.heap_calls - earlier.heap_calls, later.lock_calls - earlier.lock_calls,
          later.page_faults - earlier.page_faults, later.switched_out - earlier.switched_out,
          later.cpu_ns - earlier.cpu_ns};
}

bool RealtimeThread::start(const ThreadSettings& settings, Body body, void* context) {
  settings_ = settings;
  body_ = body;
  context_ = context;
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  stack_bytes_ = settings.stack_bytes * kFrameGrowth;
  pthread_attr_setstacksize(&attributes, stack_bytes_);
  pthread_attr_setguardsize(&attributes, kPage);
  running_ = pthread_create(&thread_, &attributes, run, this) == 0;
  pthread_attr_destroy(&attributes);
  return running_;
}

void RealtimeThread::join() noexcept {
  if (running_) pthread_join(thread_, nullptr);
  running_ = false;
}

void* RealtimeThread::run(void* self) {
  auto& thread = *static_cast<RealtimeThread*>(self);
  char name[16] = {};
  std::strncpy(name, thread.settings_.name, sizeof name - 1);
  pthread_setname_np(pthread_self(), name);
  thread.shortfall_.priority = !set_priority(thread.settings_.priority);
  thread.shortfall_.cpu = !set_cpu(thread.settings_.cpu);
  const FreeStack stack = free_stack();
  paint(stack);
  thread.body_(thread.context_);
  thread.stack_used_ = used_of(stack);
  return nullptr;
}

std::string lock_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  // with MCL_FUTURE and a limit, an allocation beyond it fails: worse than a page fault. Root has no limit
  if (limit.rlim_cur != RLIM_INFINITY && geteuid() != 0) return "the limit on locked memory is not unlimited";
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) return std::strerror(errno);
  // a page that khugepaged joins to a huge one is gone for a moment; huge pages that are there stay
  prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0);
  mallopt(M_TRIM_THRESHOLD, -1);  // what was freed stays ours
  mallopt(M_MMAP_MAX, 0);
  return {};
}

double peak_rss_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace epiline
