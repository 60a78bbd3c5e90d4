#pragma once
// Lets a thread sleep while it has nothing to read: an event count. It is independent of rings and boxes; one Parking
// serves all inputs of a thread.
#include <atomic>
#include <cstdint>

#include "platform/concurrency/counter.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/linux/futex.h"

namespace epiline {

/// One thread waits, any number of threads notify.
///
/// The word holds a count of notifications and, in its lowest bit, whether the reader is about to sleep. The reader
/// sets the bit, checks its inputs once more, and then sleeps while the word keeps that value. The producer publishes,
/// then increments the count. Both changes are read-modify-writes of one word, so one of them comes first:
///
///     reader first:    the producer's addition returns the bit: it wakes. If the reader does not sleep yet, the kernel
///                      finds another word than the reader left, and it never will.
///     producer first:  the reader's `or` reads the producer's addition and acquires what was published before it: the
///                      second look finds it.
///
/// So no wake-up is lost, and a producer whose reader is awake pays one addition and no system call.
class Parking {
 public:
  Parking() = default;
  Parking(const Parking&) = delete;
  Parking& operator=(const Parking&) = delete;

  /// Any thread, after publishing something the reader's `ready` looks at. Never waits; wakes the reader if it is
  /// parked.
  void notify() noexcept {
    // release, pairs with the acquire in wait_until(): what was published is seen by the second look
    // acquire: none needed for the data; the wake-up only needs the bit itself
    const std::uint32_t before = word_.fetch_add(kCount, std::memory_order_release);
    if ((before & kParked) != 0) futex_wake(word_);
  }

  /// Reader thread only. Sleeps until `ready()` is true or the instant of monotonic_ns() has come; returns ready().
  template <class Ready>
  bool wait_until(std::int64_t deadline_ns, Ready ready) noexcept {
    for (bool time_left = true; time_left;) {
      if (ready()) return true;
      // acquire, pairs with the release in notify()
      const std::uint32_t left = word_.fetch_or(kParked, std::memory_order_acquire) | kParked;
      const bool came = ready();  // the second look: see above
      if (!came) {
        bump(slept_);
        time_left = futex_wait_until(word_, left, deadline_ns);
      }
      word_.fetch_and(~kParked, std::memory_order_relaxed);  // only a hint for producers: a needless wake-up at worst
      if (came) return true;
    }
    const bool came = ready();
    if (!came) bump(timeouts_);
    return came;
  }

  /// How often the reader went to sleep, and how often in vain (exact: reader; a recent value elsewhere).
  std::uint64_t slept() const noexcept { return slept_.load(std::memory_order_relaxed); }
  std::uint64_t timeouts() const noexcept { return timeouts_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint32_t kParked = 1, kCount = 2;

  alignas(kCacheLine) std::atomic<std::uint32_t> word_{0};
  alignas(kCacheLine) std::atomic<std::uint64_t> slept_{0};  // one writer: the reader thread
  std::atomic<std::uint64_t> timeouts_{0};
};

}  // namespace epiline
