#include "platform/concurrency/lock_count.h"

#include <mutex>

namespace epiline {

[[gnu::tls_model("initial-exec")]] constinit thread_local std::uint64_t detail::lock_calls = 0;

bool lock_counting_available() noexcept {
  const std::uint64_t before = lock_calls_of_this_thread();
  std::mutex mutex;
  mutex.lock();
  mutex.unlock();
  return lock_calls_of_this_thread() == before + 1;
}

}  // namespace epiline
