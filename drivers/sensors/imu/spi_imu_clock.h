#pragma once
// Host stamps of the samples of a chip that tells data-ready by an edge, or that is polled.
// Derivation: docs/derivations/spi_imu_clock.md
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/time/one_way_sync.h"

namespace epiline {

/// A chip's oscillator is off by a per cent; CounterUnwrap and the usual OneWaySync are for crystals. Samples come one
/// after the other without a gap, so the counter goes on by less than a turn from each to the next.
template <int Bits>
class ChipCounter {
 public:
  void restart() noexcept { started_ = false; }
  /// Counts since the first one.
  std::int64_t advance(std::uint32_t raw) noexcept {
    raw &= kMask;
    count_ = started_ ? count_ + ((raw - last_) & kMask) : 0;
    started_ = true;
    last_ = raw;
    return count_;
  }
  /// What advance() would add.
  std::uint32_t step_to(std::uint32_t raw) const noexcept { return started_ ? (raw - last_) & kMask : 0; }
  bool started() const noexcept { return started_; }
  std::uint32_t last() const noexcept { return last_; }

 private:
  static constexpr std::uint32_t kMask = (std::uint32_t{1} << Bits) - 1;
  bool started_ = false;
  std::uint32_t last_ = 0;
  std::int64_t count_ = 0;
};

/// How fast a chip's counter runs against the host's clock, from times at which its newest count was read. A wrong idea
/// of how long one count is shows here. SampleClock follows a wrong rate only as far as oscillators differ.
class CounterRate {
 public:
  /// A count that goes back begins anew: the counter was started again.
  void add(DeviceStamp newest, HostStamp latched) noexcept;
  /// 0: not known yet.
  double rate() const noexcept { return rate_; }

 private:
  static constexpr Span kLeast = Span::from_milliseconds(5'000);  // a reader that is 10 ms late: 0.2 %
  bool started_ = false;
  DeviceStamp first_device_, last_device_;
  HostStamp first_latched_;
  double rate_ = 0;
};

/// OneWaySync for an oscillator without a crystal, whose samples are `period` apart. The model is good after `settle`.
OneWaySettings oscillator_sync(Span period, Span settle) noexcept;

struct SampleClockSettings {
  Span period;             ///< of samples, as the chip's clock counts it
  bool has_edges = false;  ///< there is a data-ready line
};

struct SampleClockCounts {
  std::uint64_t by_edge = 0;       ///< samples that have the time of their own edge
  std::uint64_t by_model = 0;      ///< samples whose edge was lost, or that are polled
  std::uint64_t edges_unused = 0;  ///< edges without a sample
  std::uint64_t unaligned = 0;     ///< samples before it was clear which edge is whose, or before the model was good
  std::uint64_t realigned = 0;     ///< times that turned out to be wrong
};

/// Which edge belongs to which sample follows from the chip's own time of both: a late reader, a lost edge or a lost
/// sample shifts nothing. Fixed memory, no clock of its own; one thread.
class SampleClock {
 public:
  explicit SampleClock(const SampleClockSettings& settings) noexcept;

  /// Of the next sample nothing is known: the chip was reset, its FIFO flushed, its counter is another.
  void restart() noexcept;

  /// In the order of time.
  void add_edge(HostStamp edge) noexcept;
  /// An edge whose sample already has its stamp.
  bool is_old(HostStamp edge) const noexcept;

  /// Stamps of samples in a row that were in the chip when it was asked, `latched` being a time after that. Edges up to
  /// `latched` have been added. `devices` are is_clock_time(). False: they have none yet, and are to be left out.
  bool stamp(std::span<const DeviceStamp> devices, HostStamp latched, std::span<HostStamp> stamps) noexcept;

  ClockState state() const noexcept { return sync_.state(); }
  const SampleClockCounts& counts() const noexcept { return counts_; }

 private:
  static constexpr std::size_t kEdges = 256;

  bool align(std::span<const DeviceStamp> devices, HostStamp latched, std::span<HostStamp> stamps) noexcept;
  bool match(std::span<const DeviceStamp> devices, HostStamp latched, std::span<HostStamp> stamps) noexcept;
  bool poll(std::span<const DeviceStamp> devices, HostStamp latched, std::span<HostStamp> stamps) noexcept;
  HostStamp match_one(DeviceStamp device) noexcept;
  void learn(DeviceStamp device, HostStamp arrival) noexcept;
  void give_up_alignment() noexcept;

  HostStamp edge_at(std::size_t i) const noexcept { return edges_[(first_edge_ + i) % kEdges]; }
  void drop_edges(std::size_t n) noexcept;

  SampleClockSettings settings_;
  OneWaySync sync_;
  std::array<HostStamp, kEdges> edges_{};
  std::size_t first_edge_ = 0, edge_count_ = 0;
  bool aligned_ = false;
  HostStamp last_stamp_;
  DeviceStamp first_device_;
  bool has_first_ = false;
  int left_over_ = 0;  ///< readings in a row that left an edge without a sample
  SampleClockCounts counts_;
};

}  // namespace epiline
