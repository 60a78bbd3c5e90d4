#pragma once
// Two threads that hand each other numbered elements. Used by the tests, on the real ring and box, and by the negative
// control, on weakened ones.
#include <array>
#include <atomic>
#include <cstdint>
#include <thread>

#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/newest_ring.h"
#include "platform/concurrency/parking.h"
#include "platform/concurrency/slot_pool.h"
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
      const Numbered* front = ring.front();
      while (front == nullptr) {
        std::this_thread::yield();
        front = ring.front();
      }
      outcome.wrong += front->is(serial) ? 0 : 1;
      ++outcome.received;
      ring.pop();
    }
  });
  std::uint64_t refused = 0;
  for (std::uint64_t serial = 0; serial < count; ++serial) {
    Numbered* slot = ring.claim();
    while (slot == nullptr) {
      ++refused;
      std::this_thread::yield();
      slot = ring.claim();
    }
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
      const Numbered* value = box.read();
      if (value == nullptr) {
        std::this_thread::yield();
        continue;
      }
      const std::uint64_t serial = value->serial();
      outcome.wrong += value->is(serial) && serial >= outcome.last ? 0 : 1;
      outcome.last = serial;
    }
  });
  for (std::uint64_t serial = 1; serial <= count; ++serial) {
    box.draft().fill(serial);
    box.publish();
    if (serial % 64 == 0) std::this_thread::yield();  // on one core the reader must have its turn
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
  for (const std::int64_t deadline_ns = monotonic_ns() + kNever_ns; !ready(); std::this_thread::yield())
    if (monotonic_ns() > deadline_ns) return false;
  return true;
}

/// Sends `count` numbered payloads in slots of a pool through a ring whose newest element wins. The consumer parks, as
/// the tracker does, and holds the payload before as well. The thread that takes a slot out of the ring gives it back.
/// The producer waits when no slot is free, and pauses now and then until all are but the one that the consumer holds.
template <class Ring, class Pool>
SlotOutcome through_slots(Ring& ring, Pool& pool, std::uint64_t count) {
  constexpr std::int64_t kDeadline_ns = 2'000'000'000;
  std::array<Numbered, 64> payload{};
  SlotOutcome outcome;
  Parking parking;
  std::atomic<bool> ended{false};
  const auto give_back = [&](typename Ring::Value slot) { pool.give_back(slot); };
  std::thread consumer([&] {
    std::uint64_t last = 0;
    int previous = Pool::kNone;
    while (true) {
      const bool woken =
          parking.wait_until(monotonic_ns() + kDeadline_ns, [&] { return ring.ready() || ended.load(); });
      if (!woken) {
        ++outcome.late;
        continue;
      }
      const typename Ring::Value slot = ring.pop(give_back);
      if (slot == Ring::kNone) {
        if (ended.load() && !ring.ready()) break;
        continue;
      }
      const std::uint64_t serial = payload[slot].serial();
      outcome.wrong += payload[slot].is(serial) && serial > last ? 0 : 1;
      if (previous != Pool::kNone) {
        outcome.wrong += payload[static_cast<std::size_t>(previous)].is(last) ? 0 : 1;  // still ours
        pool.give_back(previous);
      }
      previous = slot;
      last = serial;
      ++outcome.received;
    }
    if (previous != Pool::kNone) pool.give_back(previous);
  });
  const auto in_use = [&] {
    std::size_t sum = 0;
    for (std::size_t slot = 0; slot < pool.size(); ++slot) sum += pool.users(static_cast<int>(slot)) > 0 ? 1 : 0;
    return sum;
  };
  std::uint64_t starved = 0;
  for (std::uint64_t serial = 1; serial <= count && starved == 0;) {
    int slot = Pool::kNone;
    starved += comes_true([&] { return (slot = pool.take()) != Pool::kNone; }) ? 0 : 1;
    if (slot == Pool::kNone) break;
    payload[static_cast<std::size_t>(slot)].fill(serial++);
    const typename Ring::Value evicted = ring.push(static_cast<typename Ring::Value>(slot));
    parking.notify();
    if (evicted != Ring::kNone) pool.give_back(evicted);
    if (serial % 16 == 0) std::this_thread::yield();
    if (serial % 64 == 0) starved += comes_true([&] { return in_use() <= 1; }) ? 0 : 1;
  }
  ended.store(true);
  parking.notify();
  consumer.join();
  outcome.starved = starved;
  return outcome;
}

}  // namespace epiline::stress
