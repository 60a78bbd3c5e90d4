#pragma once
// Number of heap calls of the current thread. The counter is always linked; it counts in programs that also link the
// CMake target `epiline_allocation_count`, which interposes the malloc family (platform/linux/heap_interposer.cc).
#include <cstdint>

namespace epiline {

namespace detail {
/// Written by the interposer only. Initial-exec: the counter must be reachable without an allocation of its own.
[[gnu::tls_model("initial-exec")]] extern constinit thread_local std::uint64_t heap_calls;
}  // namespace detail

/// Calls of malloc, calloc, realloc, aligned_alloc and their kin by this thread since it began, `new` included. Calls
/// of free do not count. Always 0 where allocation_counting_available() is false.
inline std::uint64_t heap_calls_of_this_thread() noexcept {
  // volatile: compilers take malloc for a function that changes no variable, and would reuse an earlier reading.
  return *static_cast<const volatile std::uint64_t*>(&detail::heap_calls);
}

/// True if heap calls really are counted in this program; found out by making one. False without the interposer, under
/// a sanitizer that brings its own malloc, and on C libraries other than glibc.
bool allocation_counting_available() noexcept;

/// Heap calls of this thread since the scope began. Read it on the thread that made it.
class HeapCallScope {
 public:
  HeapCallScope() noexcept : begin_(heap_calls_of_this_thread()) {}
  std::uint64_t calls() const noexcept { return heap_calls_of_this_thread() - begin_; }

 private:
  std::uint64_t begin_;
};

}  // namespace epiline
