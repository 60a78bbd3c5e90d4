#pragma once
// A circular buffer for the newest samples of a flight, in fixed memory. It consists of segments; a new one replaces
// the oldest. A reader can borrow segments while recording continues in the others.
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace epiline {

/// Segments are numbered consecutively; number s is stored at s % segments(). One thread writes, another one reads the
/// lent segments.
class Tape {
 public:
  /// A record: `kind` as the caller chose it, `bytes` as written.
  struct Record {
    std::uint32_t kind = 0;
    std::span<const std::byte> bytes;
  };
  /// Segments [from, to).
  struct Range {
    std::uint64_t from = 0, to = 0;
  };

  /// Allocates and touches all memory. `kept` of the segments can be lent at once; recording continues in the others. A
  /// segment holds records of up to `segment_bytes` in total; each takes 8 bytes more and is rounded up to 8.
  Tape(std::size_t segments, std::size_t kept, std::size_t segment_bytes);

  static constexpr std::size_t bytes_of_record(std::size_t bytes) { return kHeader + (bytes + 7) / 8 * 8; }
  std::size_t memory_bytes() const { return memory_.size(); }

  // Writer.

  /// Space for a record of that many bytes, 8-byte aligned; commit() completes the record. Null, and counted in lost(),
  /// if it is larger than a segment or the reader still needs the next segment.
  std::byte* claim(std::uint32_t kind, std::size_t bytes) noexcept;
  void commit() noexcept;
  /// Appends a plain object.
  template <class T>
  bool append(std::uint32_t kind, const T& value) noexcept {
    static_assert(std::is_trivially_copyable_v<T>);
    std::byte* const room = claim(kind, sizeof value);
    if (room == nullptr) return false;
    std::memcpy(room, &value, sizeof value);
    commit();
    return true;
  }
  /// Ends the current segment and lends the newest ones, including it. Call only while nothing is lent.
  Range lend() noexcept;
  std::uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }

  // Reader.

  /// Calls `f(Record)` for each record of a lent segment, in the order of writing.
  template <class F>
  void each(std::uint64_t segment, F&& f) const {
    const std::size_t slot = segment % used_.size();
    const std::byte* at = memory_.data() + slot * segment_bytes_;
    for (const std::byte* const end = at + used_[slot]; at < end;) {
      Header header;
      std::memcpy(&header, at, sizeof header);
      f(Record{header.kind, {at + kHeader, header.bytes}});
      at += bytes_of_record(header.bytes);
    }
  }
  /// Returns all lent segments before this one.
  void done_before(std::uint64_t segment) noexcept {
    // release, pairs with the acquire in claim(): our last look at a segment comes before it is written over
    needed_from_.store(segment, std::memory_order_release);
  }
  /// Returns all lent segments.
  void done() noexcept { done_before(kNothing); }

 private:
  struct Header {
    std::uint32_t bytes = 0, kind = 0;
  };
  static constexpr std::size_t kHeader = sizeof(Header);
  static constexpr std::uint64_t kNothing = ~std::uint64_t{0};

  bool next_segment() noexcept;

  std::size_t segment_bytes_, kept_;
  std::vector<std::byte> memory_;
  std::vector<std::size_t> used_;  ///< bytes of each segment
  std::uint64_t current_ = 0;      ///< the segment being written
  std::size_t claimed_ = 0;
  std::atomic<std::uint64_t> lost_{0};
  std::atomic<std::uint64_t> needed_from_{kNothing};  ///< the first segment the reader still needs
};

}  // namespace epiline
