#pragma once
// Two threads that hand each other numbered elements. Used by the tests, on the real ring and box, and by the negative
// control, on weakened ones.
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>

#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/loans.h"
#include "platform/concurrency/newest_ring.h"
#include "platform/concurrency/parking.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/time/monotonic.h"

namespace epiline::stress {

/// An element that shows when it is torn: every word is derived from the serial number.
struct Numbered {
  std::array<std::uint64_t, 12> words{};

  void fill(std::uint64_t serial) {
    for (std::uint64_t i = 0; i < words.size(); ++i) words[i] = serial * 0x9E3779B97F4A7C15u + i;
  }
  bool is(std::uint64_t serial) const {
    Numbered expected;
    expected.fill(serial);
    return words == expected.words;
  }
  std::uint64_t serial() const { return words[0] * 0xF1DE83E19937733Du; }  // inverse of the multiplier modulo 2^64
};

/// Waits for `ready()`. The other thread most likely runs and is soon there; if it does not, a sleeper gets its turn
/// before busy programs do, and one that yields after them.
template <class Ready>
void wait_for(Ready&& ready) {
  while (true) {
    for (int i = 0; i < 100; ++i) {
      if (ready()) return;
    }
    std::this_thread::sleep_for(std::chrono::microseconds(10));
  }
}

struct RingOutcome {
  std::uint64_t wrong = 0;     ///< elements that were torn or out of order
  std::uint64_t received = 0;  ///< elements the consumer took
  std::uint64_t refused = 0;   ///< pushes the producer saw refused
};

/// Moves `count` elements through a ring; a refused one is tried again.
template <class Ring>
RingOutcome through_ring(Ring& ring, std::uint64_t count) {
  RingOutcome outcome;
  std::thread consumer([&] {
    for (std::uint64_t serial = 0; serial < count; ++serial) {
      const Numbered* front = nullptr;
      wait_for([&] { return (front = ring.front()) != nullptr; });
      outcome.wrong += front->is(serial) ? 0 : 1;
      ++outcome.received;
      ring.pop();
    }
  });
  std::uint64_t refused = 0;
  for (std::uint64_t serial = 0; serial < count; ++serial) {
    Numbered* slot = nullptr;
    wait_for([&] {
      slot = ring.claim();
      refused += slot == nullptr ? 1 : 0;
      return slot != nullptr;
    });
    slot->fill(serial);
    ring.publish();
  }
  consumer.join();
  outcome.refused = refused;
  return outcome;
}

struct BoxOutcome {
  std::uint64_t wrong = 0;  ///< values that were torn or older than one seen before
  std::uint64_t last = 0;   ///< serial of the value that was read last
};

/// Writes the serials 1 to `count` into a box while another thread reads until it sees the last one.
template <class Box>
BoxOutcome through_box(Box& box, std::uint64_t count) {
  BoxOutcome outcome;
  std::thread reader([&] {
    while (outcome.last < count && outcome.wrong == 0) {
      wait_for([&] {
        const Numbered* value = box.read();
        if (value == nullptr) return false;
        const std::uint64_t serial = value->serial(), before = outcome.last;
        outcome.wrong += value->is(serial) && serial >= before ? 0 : 1;
        outcome.last = serial;
        return serial != before || outcome.wrong > 0;
      });
    }
  });
  for (std::uint64_t serial = 1; serial <= count; ++serial) {
    box.draft().fill(serial);
    box.publish();
    if (serial % 64 == 0)
      std::this_thread::sleep_for(std::chrono::microseconds(1));  // on one core the reader must have its turn
  }
  reader.join();
  return outcome;
}

struct SlotOutcome {
  std::uint64_t wrong = 0;     ///< payloads that were torn, or older than one seen before
  std::uint64_t received = 0;  ///< slots the consumer took
  std::uint64_t late = 0;      ///< sleeps of the consumer that ended at their deadline though something was there
  std::uint64_t starved = 0;   ///< waits of the producer for slots that did not come back
};

/// True as soon as `ready()` is; false if it is not for so long that it never will be.
template <class Ready>
bool comes_true(Ready&& ready) {
  constexpr std::int64_t kNever_ns = 10'000'000'000;
  for (const std::int64_t deadline_ns = monotonic_ns() + kNever_ns; !ready();) {
    if (monotonic_ns() > deadline_ns) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(10));  // a yield would keep the others from a processor
  }
  return true;
}

/// Numbered payloads in slots that are lent and come back, as a camera's images do.
template <std::size_t N, class Orders>
struct Lender {
  explicit Lender(std::size_t slots) : size(slots) {}

  /// Producer thread only: a slot that is not lent, or `size`.
  std::size_t free_slot() const {
    std::size_t slot = 0;
    while (slot < size && is_lent[slot].load(std::memory_order_acquire)) ++slot;
    return slot;
  }
  std::size_t number_lent() const {
    std::size_t sum = 0;
    for (const auto& lent : is_lent) sum += lent.load(std::memory_order_acquire) ? 1 : 0;
    return sum;
  }
  void lend(std::size_t slot) {
    is_lent[slot].store(true, std::memory_order_relaxed);
    loans.lend(slot);
  }
  void give_back(std::size_t slot) {
    if (loans.give_back(slot)) is_lent[slot].store(false, std::memory_order_release);
  }

  std::size_t size;
  Loans<N, Orders> loans;
  std::array<std::atomic<bool>, N> is_lent{};
  std::array<Numbered, N> payload{};
};

/// Sends `count` numbered payloads in lent slots through a ring whose newest element wins. The consumer parks, as the
/// tracker does, and holds the payload before as well; it shares some with a third thread, as the tracker does with the
/// log. The producer waits when no slot is free, and pauses now and then until all have come back but the one that
/// the consumer holds.
template <class Ring, std::size_t N, class Orders>
class SlotTraffic {
 public:
  SlotTraffic(Ring& ring, Lender<N, Orders>& lender, std::uint64_t count)
      : ring_(ring), lender_(lender), count_(count) {}

  SlotOutcome run() {
    std::thread log([&] { read_shared(); });
    std::thread consumer([&] { consume(); });
    produce();
    ended_.store(true);
    parking_.notify();
    consumer.join();
    consumed_.store(true);
    log_parking_.notify();
    log.join();
    outcome_.starved = starved_;
    outcome_.wrong += wrong_in_log_;
    return outcome_;
  }

 private:
  struct Shared {
    std::size_t slot = 0;
    std::uint64_t serial = 0;
  };

  void produce() {
    for (std::uint64_t serial = 1; serial <= count_ && starved_ == 0; ++serial) {
      std::size_t slot = lender_.size;
      starved_ += comes_true([&] { return (slot = lender_.free_slot()) < lender_.size; }) ? 0 : 1;
      if (slot == lender_.size) return;
      lender_.payload[slot].fill(serial);
      lender_.lend(slot);
      const auto evicted = ring_.push(static_cast<typename Ring::Value>(slot));
      parking_.notify();
      if (evicted != Ring::kNone) lender_.give_back(evicted);
      if (serial % 16 == 0) std::this_thread::sleep_for(std::chrono::microseconds(1));
      if (serial % 64 == 0) starved_ += comes_true([&] { return lender_.number_lent() <= 1; }) ? 0 : 1;
    }
  }

  void consume() {
    const auto give_back = [&](typename Ring::Value slot) { lender_.give_back(slot); };
    std::size_t previous = N;
    std::uint64_t last = 0;
    while (true) {
      const bool woken =
          parking_.wait_until(monotonic_ns() + kDeadline_ns, [&] { return ring_.ready() || ended_.load(); });
      if (!woken && ring_.ready()) ++outcome_.late;
      const typename Ring::Value slot = ring_.pop(give_back);
      if (slot == Ring::kNone) {
        if (ended_.load() && !ring_.ready()) break;
        continue;
      }
      const std::uint64_t serial = lender_.payload[slot].serial();
      outcome_.wrong += lender_.payload[slot].is(serial) && serial > last ? 0 : 1;
      lender_.loans.share(slot);
      if (!shared_.push({slot, serial})) lender_.give_back(slot);
      log_parking_.notify();
      if (previous != N) {
        outcome_.wrong += lender_.payload[previous].is(last) ? 0 : 1;  // still ours
        lender_.give_back(previous);
      }
      previous = slot;
      last = serial;
      ++outcome_.received;
    }
    if (previous != N) lender_.give_back(previous);
  }

  void read_shared() {
    bool over = false;
    while (!over) {
      log_parking_.wait_until(monotonic_ns() + kDeadline_ns, [&] {
        over = consumed_.load();  // before the look at the ring: what came before is found
        return shared_.front() != nullptr || over;
      });
      for (Shared next; shared_.pop(next);) {
        wrong_in_log_ += lender_.payload[next.slot].is(next.serial) ? 0 : 1;
        lender_.give_back(next.slot);
      }
    }
  }

  static constexpr std::int64_t kDeadline_ns = 2'000'000'000;
  Ring& ring_;
  Lender<N, Orders>& lender_;
  std::uint64_t count_, starved_ = 0, wrong_in_log_ = 0;
  SlotOutcome outcome_;
  Parking parking_, log_parking_;
  SpscRing<Shared, 1> shared_;
  std::atomic<bool> ended_{false}, consumed_{false};
};

}  // namespace epiline::stress
