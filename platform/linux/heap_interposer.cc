// Counts the heap calls of each thread: definitions of the malloc family in the program take precedence over those of
// glibc, count, and forward to glibc's own names. free stays glibc's. Linked by programs and tests that ask for it
// (`epiline_allocation_count`), never by users of the library.
#include <cerrno>
#include <cstddef>
#include <cstdlib>

#include "platform/memory/allocation_count.h"
#include "platform/memory/sanitizers.h"

#if defined(__GLIBC__) && !defined(EPILINE_UNDER_SANITIZER)

// Reserved names: they are the C library's, and standing in for them is the purpose.
// NOLINTBEGIN(readability-identifier-naming)
extern "C" {

void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) noexcept {
  ++epiline::detail::heap_calls;
  return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) noexcept {
  ++epiline::detail::heap_calls;
  return __libc_calloc(count, size);
}

void* realloc(void* old, std::size_t size) noexcept {
  ++epiline::detail::heap_calls;
  return __libc_realloc(old, size);
}

void* reallocarray(void* old, std::size_t count, std::size_t size) noexcept {
  std::size_t bytes = 0;
  if (__builtin_mul_overflow(count, size, &bytes)) {
    errno = ENOMEM;
    return nullptr;
  }
  return realloc(old, bytes);
}

void* memalign(std::size_t alignment, std::size_t size) noexcept {
  ++epiline::detail::heap_calls;
  return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept { return memalign(alignment, size); }

int posix_memalign(void** out, std::size_t alignment, std::size_t size) noexcept {
  const bool power_of_two = alignment != 0 && (alignment & (alignment - 1)) == 0;
  if (!power_of_two || alignment % sizeof(void*) != 0) return EINVAL;
  void* const memory = memalign(alignment, size);
  if (memory == nullptr) return ENOMEM;
  *out = memory;
  return 0;
}

}  // extern "C"
// NOLINTEND(readability-identifier-naming)

#endif
