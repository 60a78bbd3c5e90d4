// Counts the locks each thread goes to: definitions of the C library's functions in the program take precedence, count,
// and call those they stand for. Linked by programs and tests that ask for it (`epiline_lock_count`).
#include <dlfcn.h>
#include <pthread.h>
#include <ctime>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/sanitizers.h"

#if defined(__GLIBC__) && !defined(EPILINE_UNDER_SANITIZER)

namespace {

// Found at the first call: before main, by the start-up code of some library. Zero-initialised, so it needs no
// constructor that could come too late; two threads that both find it store the same.
template <class F>
F next(F& known, const char* name) {
  F found = __atomic_load_n(&known, __ATOMIC_ACQUIRE);
  if (found == nullptr) {
    found = reinterpret_cast<F>(dlsym(RTLD_NEXT, name));
    __atomic_store_n(&known, found, __ATOMIC_RELEASE);
  }
  return found;
}

}  // namespace

// A function that counts the call and makes it.
#define EPILINE_COUNTED(name, parameters, arguments) \
  int name parameters {                              \
    static int(*known) parameters;                   \
    ++epiline::detail::lock_calls;                   \
    return next(known, #name) arguments;             \
  }

extern "C" {

EPILINE_COUNTED(pthread_mutex_lock, (pthread_mutex_t * mutex) noexcept, (mutex))
EPILINE_COUNTED(pthread_mutex_trylock, (pthread_mutex_t * mutex) noexcept, (mutex))
EPILINE_COUNTED(pthread_mutex_timedlock, (pthread_mutex_t * mutex, const timespec* deadline) noexcept,
                (mutex, deadline))
// What the standard library calls for a time on its steady clock.
EPILINE_COUNTED(pthread_mutex_clocklock, (pthread_mutex_t * mutex, clockid_t clock, const timespec* deadline) noexcept,
                (mutex, clock, deadline))
EPILINE_COUNTED(pthread_cond_wait, (pthread_cond_t * condition, pthread_mutex_t* mutex), (condition, mutex))
EPILINE_COUNTED(pthread_cond_timedwait, (pthread_cond_t * condition, pthread_mutex_t* mutex, const timespec* deadline),
                (condition, mutex, deadline))
EPILINE_COUNTED(pthread_cond_clockwait,
                (pthread_cond_t * condition, pthread_mutex_t* mutex, clockid_t clock, const timespec* deadline),
                (condition, mutex, clock, deadline))

}  // extern "C"

#endif
