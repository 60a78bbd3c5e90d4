#include "drivers/sensors/camera/edge_stamps.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {

constexpr std::size_t kEdgesToBegin = 4;
constexpr int kToLearn = 8;       // images in a row that agree, before the lag is known
constexpr int kToAnchor = 3;      // and with the lag known
constexpr double kWindow = 0.25;  // of a period: so far from the usual lag it is not this edge
constexpr double kTooSoon = 0.6;  // of a period after the edge before: a bounce, a glitch
constexpr int kOddMost = 16;      // extra edges count 2, missing ones 1, good ones take 1 away
constexpr double kRateShare = 1.0 / 16;
constexpr double kLongGap = 16;           // periods without an edge: counting over them is not safe
constexpr std::int64_t kExtrapolate = 3;  // periods from the nearest edge that its rate is good for
constexpr double kLagShare = 1.0 / 16;
constexpr std::uint64_t EdgeCounts::*kCounterOf[] = {&EdgeCounts::matched, &EdgeCounts::without_edge,
                                                     &EdgeCounts::unsure, &EdgeCounts::mismatched};

}  // namespace

void EdgeStamps::add_edge(HostStamp edge) noexcept {
  if (counts_.edges++ == 0) {
    newest_ = edge;
    return;
  }
  const auto passed_ns = static_cast<double>((edge - newest_).ns);
  if (learned_ < kToLearnRate) {
    newest_ = edge;
    learn(edge, passed_ns);
    return;
  }
  const double periods = passed_ns / usual_ns_, whole = std::round(periods);
  const bool is_next = periods >= kTooSoon && (whole > kLongGap || std::abs(periods - whole) <= kWindow);
  odd_ = std::max(odd_ + (!is_next ? 2 : whole > 1 ? 1 : -1), 0);
  if (odd_ >= kOddMost) {  // the rate is another
    learned_ = 0;
    count_ = 0;
    newest_ = edge;
    restart();
    return;
  }
  if (!is_next) {
    ++counts_.extra;
    return;
  }
  newest_ = edge;
  if (whole == 1) usual_ns_ += kRateShare * (passed_ns - usual_ns_);
  if (whole > kLongGap) restart();
  const auto step = static_cast<std::int64_t>(std::min(whole, 1e9));
  counts_.missing += static_cast<std::uint64_t>(step - 1);
  push({edge, at(count_ - 1).number + step});
}

/// The third shortest of some intervals: neither a bounce nor those that an edge is missing from.
void EdgeStamps::learn(HostStamp edge, double passed_ns) noexcept {
  first_intervals_ns_[static_cast<std::size_t>(learned_++)] = passed_ns;
  if (learned_ < kToLearnRate) return;
  std::sort(first_intervals_ns_.begin(), first_intervals_ns_.end());
  usual_ns_ = std::max(first_intervals_ns_[2], 1.0);
  odd_ = 0;
  push({edge, 0});
}

void EdgeStamps::push(const Cycle& cycle) noexcept {
  if (count_ == kEdges) first_ = (first_ + 1) % kEdges, --count_;
  ++count_;
  ring_[(first_ + count_ - 1) % kEdges] = cycle;
}

const EdgeStamps::Cycle& EdgeStamps::nearest(HostStamp instant) const noexcept {
  std::size_t best = 0;
  for (std::size_t i = 1; i < count_; ++i)
    if (std::abs((at(i).edge - instant).ns) < std::abs((at(best).edge - instant).ns)) best = i;
  return at(best);
}

double EdgeStamps::period_ns() const noexcept {
  const Cycle &oldest = at(0), &newest = at(count_ - 1);
  return static_cast<double>((newest.edge - oldest.edge).ns) / static_cast<double>(newest.number - oldest.number);
}

EdgeMatch EdgeStamps::match(std::uint64_t sequence, HostStamp& start) noexcept {
  const EdgeMatch match = judge(sequence, start);
  ++(counts_.*kCounterOf[static_cast<std::size_t>(match)]);
  counts_.lag = Span{static_cast<std::int64_t>(lag_ns_)};
  counts_.period = Span{count_ >= kEdgesToBegin ? static_cast<std::int64_t>(period_ns()) : 0};
  return match;
}

EdgeMatch EdgeStamps::judge(std::uint64_t sequence, HostStamp& start) noexcept {
  if (count_ < kEdgesToBegin) return EdgeMatch::kUnsure;
  const double period = period_ns();
  const HostStamp expected = start - Span{static_cast<std::int64_t>(lag_ns_)};
  const Cycle& edge = nearest(expected);
  const double away = static_cast<double>((expected - edge.edge).ns);
  const double periods = std::round(away / period);
  const bool is_near = std::abs(away) <= (has_lag_ ? kWindow : 0.5) * period;
  const std::int64_t offset = edge.number + static_cast<std::int64_t>(periods) - static_cast<std::int64_t>(sequence);
  if (!is_near && !has_lag_) return agreeing_ = 0, EdgeMatch::kUnsure;
  if (is_near && anchored_ && offset == offset_) {
    agreeing_ = 0;
    lag_ns_ += kLagShare * away;
    start = edge.edge;
    return EdgeMatch::kEdge;
  }
  if (is_near) {  // the count says another edge, or nothing yet
    const bool was_anchored = anchored_;
    if (!agrees(offset, away, has_lag_ ? kToAnchor : kToLearn))
      return was_anchored ? EdgeMatch::kMismatch : EdgeMatch::kUnsure;
    if (was_anchored) ++counts_.resynchronised;
    if (!has_lag_) lag_ns_ = residual_sum_ns_ / agreeing_;
    has_lag_ = anchored_ = true;
    offset_ = offset;
    agreeing_ = 0;
    start = edge.edge;
    return EdgeMatch::kEdge;
  }
  // No edge where one is expected: it was lost, if the image lies in the grid of the others; or there are no more.
  if (std::abs(periods) > kExtrapolate) {
    start = expected;
    return EdgeMatch::kNoEdge;
  }
  const bool is_in_grid = std::abs(away - periods * period) <= kWindow * period;
  if (!is_in_grid || (anchored_ && offset != offset_)) return EdgeMatch::kMismatch;
  start = edge.edge + Span{static_cast<std::int64_t>(periods * period)};
  return EdgeMatch::kNoEdge;
}

/// Whether so many images in a row have said the same, this one included.
bool EdgeStamps::agrees(std::int64_t offset, double residual_ns, int wanted) noexcept {
  if (agreeing_ == 0 || offset != other_offset_) {
    agreeing_ = 0;
    other_offset_ = offset;
    residual_least_ns_ = residual_most_ns_ = residual_ns;
    residual_sum_ns_ = 0;
  }
  ++agreeing_;
  residual_sum_ns_ += residual_ns;
  residual_least_ns_ = std::min(residual_least_ns_, residual_ns);
  residual_most_ns_ = std::max(residual_most_ns_, residual_ns);
  if (residual_most_ns_ - residual_least_ns_ > 2 * kWindow * period_ns()) agreeing_ = 0;  // stamps scatter too much
  return agreeing_ >= wanted;
}

}  // namespace epiline
