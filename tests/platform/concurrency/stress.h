#pragma once
// Two threads that hand each other numbered elements. Used by the tests, on the real ring and box, and by the negative
// control, on weakened ones.
#include <array>
#include <cstdint>
#include <thread>

#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/spsc_ring.h"

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

}  // namespace epiline::stress
