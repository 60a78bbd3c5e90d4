#include "platform/memory/allocation_count.h"

#include <cstdlib>

namespace epiline {

[[gnu::tls_model("initial-exec")]] constinit thread_local std::uint64_t detail::heap_calls = 0;

bool allocation_counting_available() noexcept {
  const HeapCallScope scope;
  void* volatile probe = std::malloc(1);  // volatile: the pair must not be optimised away
  std::free(probe);
  return scope.calls() == 1;
}

}  // namespace epiline
