#pragma once
// The state of a thread, readable by other threads.
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace epiline {

/// The newest value, from one writer thread to any number of readers: a sequence lock. The writer never waits. A reader
/// repeats its copy if the value was written meanwhile, so the time between writes should be much longer than a copy.
/// Use it for counters and states that are read occasionally, not for samples.
template <class T>
class Snapshot {
  static_assert(std::is_trivially_copyable_v<T> && std::is_nothrow_default_constructible_v<T>);

 public:
  Snapshot() noexcept { write(T{}); }
  Snapshot(const Snapshot&) = delete;
  Snapshot& operator=(const Snapshot&) = delete;

  /// Writer thread only.
  void write(const T& value) noexcept {
    Words words{};
    std::memcpy(words.data(), &value, sizeof value);
    const std::uint64_t before = version_.load(std::memory_order_relaxed);  // own
    version_.store(before + 1, std::memory_order_relaxed);
    // release: a reader that sees a new word sees the odd version before it, and copies again
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(words[i], std::memory_order_release);
    // release, pairs with the first load in read(): the version after is seen with all words
    version_.store(before + 2, std::memory_order_release);
  }

  /// Any thread.
  T read() const noexcept {
    Words words{};
    for (;;) {
      const std::uint64_t before = version_.load(std::memory_order_acquire);
      for (std::size_t i = 0; i < kWords; ++i) words[i] = words_[i].load(std::memory_order_acquire);
      if (before % 2 == 0 && version_.load(std::memory_order_relaxed) == before) break;
    }
    T value;
    std::memcpy(static_cast<void*>(&value), words.data(), sizeof value);
    return value;
  }

 private:
  static constexpr std::size_t kWords = (sizeof(T) + 7) / 8;
  using Words = std::array<std::uint64_t, kWords>;

  std::atomic<std::uint64_t> version_{0};
  std::array<std::atomic<std::uint64_t>, kWords> words_{};
};

}  // namespace epiline
