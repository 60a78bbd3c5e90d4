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

int (*mutex_lock)(pthread_mutex_t*);
int (*mutex_trylock)(pthread_mutex_t*);
int (*mutex_timedlock)(pthread_mutex_t*, const timespec*);
int (*mutex_clocklock)(pthread_mutex_t*, clockid_t, const timespec*);
int (*cond_wait)(pthread_cond_t*, pthread_mutex_t*);
int (*cond_timedwait)(pthread_cond_t*, pthread_mutex_t*, const timespec*);
int (*cond_clockwait)(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*);

}  // namespace

extern "C" {

int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  ++epiline::detail::lock_calls;
  return next(mutex_lock, "pthread_mutex_lock")(mutex);
}

int pthread_mutex_trylock(pthread_mutex_t* mutex) noexcept {
  ++epiline::detail::lock_calls;
  return next(mutex_trylock, "pthread_mutex_trylock")(mutex);
}

int pthread_mutex_timedlock(pthread_mutex_t* mutex, const timespec* deadline) noexcept {
  ++epiline::detail::lock_calls;
  return next(mutex_timedlock, "pthread_mutex_timedlock")(mutex, deadline);
}

// What the standard library calls for a time on its steady clock.
int pthread_mutex_clocklock(pthread_mutex_t* mutex, clockid_t clock, const timespec* deadline) noexcept {
  ++epiline::detail::lock_calls;
  return next(mutex_clocklock, "pthread_mutex_clocklock")(mutex, clock, deadline);
}

int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
  ++epiline::detail::lock_calls;
  return next(cond_wait, "pthread_cond_wait")(condition, mutex);
}

int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* deadline) {
  ++epiline::detail::lock_calls;
  return next(cond_timedwait, "pthread_cond_timedwait")(condition, mutex, deadline);
}

int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock,
                           const timespec* deadline) {
  ++epiline::detail::lock_calls;
  return next(cond_clockwait, "pthread_cond_clockwait")(condition, mutex, clock, deadline);
}

}  // extern "C"

#endif
