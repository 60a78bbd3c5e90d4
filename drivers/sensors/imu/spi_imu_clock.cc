#include "drivers/sensors/imu/spi_imu_clock.h"

#include <algorithm>

namespace epiline {

namespace {

constexpr double kSlopeMost = 0.04;  // oscillators without a crystal: 3 % over temperature at worst
constexpr Span kSettleEdges = Span::from_milliseconds(30), kSettlePolls = Span::from_milliseconds(500);
constexpr Span kWindow = Span::from_milliseconds(10'000);  // they drift with temperature
constexpr Span kWithoutEdges = Span::from_milliseconds(1'000);
constexpr int kLeftOverMost = 64;

OneWaySettings sync_settings(const SampleClockSettings& settings) noexcept {
  return oscillator_sync(settings.period, settings.has_edges ? kSettleEdges : kSettlePolls);
}

}  // namespace

OneWaySettings oscillator_sync(Span period, Span settle) noexcept {
  OneWaySettings sync;
  sync.envelope.window = kWindow;
  // While the limit of the slope grows, the model errs by at most 1 % of a twelfth of this, if the clock is 1 % off.
  sync.envelope.settle = std::max(settle, Span{8 * period.ns});
  sync.envelope.slope_most = kSlopeMost;
  sync.early = std::max(sync.early, Span{period.ns / 2});
  sync.late = std::max(sync.late, Span{2 * period.ns});
  return sync;
}

void CounterRate::add(DeviceStamp newest, HostStamp latched) noexcept {
  if (!started_ || newest < last_device_) {
    started_ = true;
    first_device_ = newest;
    first_latched_ = latched;
  }
  last_device_ = newest;
  const Span passed = latched - first_latched_;
  if (passed >= kLeast) rate_ = (newest - first_device_).seconds() / passed.seconds();
}

SampleClock::SampleClock(const SampleClockSettings& settings) noexcept
    : settings_(settings), sync_(sync_settings(settings)) {}

void SampleClock::restart() noexcept {
  sync_ = OneWaySync(sync_settings(settings_));
  first_edge_ = edge_count_ = 0;
  aligned_ = has_first_ = false;
  left_over_ = 0;
}

void SampleClock::add_edge(HostStamp edge) noexcept {
  if (edge_count_ == kEdges) {
    drop_edges(1);
    ++counts_.edges_unused;
  }
  edges_[(first_edge_ + edge_count_) % kEdges] = edge;
  ++edge_count_;
}

void SampleClock::drop_edges(std::size_t n) noexcept {
  first_edge_ = (first_edge_ + n) % kEdges;
  edge_count_ -= n;
}

bool SampleClock::is_old(HostStamp edge) const noexcept {
  return aligned_ && edge < last_stamp_ + Span{settings_.period.ns / 2};
}

bool SampleClock::stamp(std::span<const DeviceStamp> devices, HostStamp latched, std::span<HostStamp> stamps) noexcept {
  if (devices.empty()) return true;
  if (!has_first_) {
    has_first_ = true;
    first_device_ = devices.front();
  }
  const bool edges_missing =
      !aligned_ && edge_count_ == 0 && devices.back() - first_device_ >= kWithoutEdges;  // polled for now
  bool known = false;
  if (!settings_.has_edges || edges_missing) {
    known = poll(devices, latched, stamps);
  } else if (aligned_) {
    known = match(devices, latched, stamps);
  } else {
    known = align(devices, latched, stamps);
  }
  if (!known) {
    counts_.unaligned += devices.size();
    return false;
  }
  last_stamp_ = stamps[devices.size() - 1];
  return true;
}

void SampleClock::learn(DeviceStamp device, HostStamp arrival) noexcept { sync_.update(device, arrival); }

bool SampleClock::poll(std::span<const DeviceStamp> devices, HostStamp latched, std::span<HostStamp> stamps) noexcept {
  learn(devices.back(), latched);
  for (std::size_t i = 0; i < devices.size(); ++i) stamps[i] = sync_.translate(devices[i]);
  if (sync_.state().window < kSettlePolls) return false;
  counts_.by_model += devices.size();
  return true;
}

/// As many edges as samples, and the reader came before the next: then they belong together, in order.
bool SampleClock::align(std::span<const DeviceStamp> devices, HostStamp latched, std::span<HostStamp> stamps) noexcept {
  const std::int64_t period_ns = settings_.period.ns;
  const bool fits = edge_count_ == devices.size() && latched >= edge_at(edge_count_ - 1) &&
                    (latched - edge_at(edge_count_ - 1)).ns < period_ns * 9 / 10;
  bool spaced = fits;
  for (std::size_t i = 1; spaced && i < devices.size(); ++i) {
    const Span apart = edge_at(i) - edge_at(i - 1) - (devices[i] - devices[i - 1]);
    spaced = apart.ns > -period_ns / 3 && apart.ns < period_ns / 3;
  }
  if (!spaced) {
    counts_.edges_unused += edge_count_;
    drop_edges(edge_count_);
    return false;
  }
  sync_ = OneWaySync(sync_settings(settings_));
  for (std::size_t i = 0; i < devices.size(); ++i) {
    stamps[i] = edge_at(i);
    learn(devices[i], stamps[i]);
  }
  counts_.by_edge += devices.size();
  drop_edges(edge_count_);
  aligned_ = true;
  left_over_ = 0;
  return true;
}

bool SampleClock::match(std::span<const DeviceStamp> devices, HostStamp latched, std::span<HostStamp> stamps) noexcept {
  // a sample cannot have been read before it was taken
  if (sync_.translate(devices.back()) > latched + Span{settings_.period.ns * 3 / 10}) {
    give_up_alignment();
    return false;
  }
  const std::uint64_t by_model = counts_.by_model;
  for (std::size_t i = 0; i < devices.size(); ++i) stamps[i] = match_one(devices[i]);
  if (counts_.by_model != by_model) {
    learn(devices.back(), latched);  // an upper bound is better than nothing
    if (sync_.state().status == ClockStatus::kSettling) {
      counts_.by_model = by_model;
      return false;
    }
  }
  left_over_ = edge_count_ > 0 && edge_at(0) <= latched ? left_over_ + 1 : 0;
  if (left_over_ >= kLeftOverMost) {
    give_up_alignment();
    return false;
  }
  return true;
}

HostStamp SampleClock::match_one(DeviceStamp device) noexcept {
  const HostStamp expected = sync_.translate(device);
  const Span near{settings_.period.ns * 2 / 5};
  while (edge_count_ > 0 && edge_at(0) < expected - near) {
    drop_edges(1);
    ++counts_.edges_unused;
  }
  if (edge_count_ == 0 || edge_at(0) > expected + near) {
    ++counts_.by_model;
    return expected;
  }
  const HostStamp edge = edge_at(0);
  drop_edges(1);
  learn(device, edge);
  ++counts_.by_edge;
  return edge;
}

void SampleClock::give_up_alignment() noexcept {
  ++counts_.realigned;
  restart();
}

}  // namespace epiline
