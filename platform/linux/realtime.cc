#include "platform/linux/realtime.h"

#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::size_t kMostPrefault = 1024 * 1024, kStack = 8 * 1024 * 1024;

/// Touches the stack below, so that no page of it has to be found later. Not inlined: its frame must be a deep one.
[[gnu::noinline]] void prefault_stack(std::size_t bytes) {
  constexpr std::size_t kPage = 4096;
  char depth[kMostPrefault];
  for (std::size_t i = 0; i < bytes && i < kMostPrefault; i += kPage) depth[kMostPrefault - 1 - i] = 0;
  asm volatile("" : : "r"(depth) : "memory");  // the writes must not be optimised away
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
  pthread_attr_setstacksize(&attributes, kStack);
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
  prefault_stack(thread.settings_.prefault_bytes);
  thread.body_(thread.context_);
  return nullptr;
}

std::string lock_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  // with MCL_FUTURE and a limit, an allocation beyond it fails: worse than a page fault. Root has no limit
  if (limit.rlim_cur != RLIM_INFINITY && geteuid() != 0) return "the limit on locked memory is not unlimited";
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) return std::strerror(errno);
  mallopt(M_TRIM_THRESHOLD, -1);  // what was freed stays ours
  mallopt(M_MMAP_MAX, 0);
  return {};
}

}  // namespace epiline
