#include "drivers/sensors/camera/exposure_timeline.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace epiline {

namespace {

constexpr double kLeastLogRatio = 0.15;           // smaller steps drown in what moves through the picture
constexpr double kDarkest = 8, kBrightest = 235;  // beyond, brightness does not follow exposure
constexpr int kVotes = 3;                         // that agree, and are two thirds of all
constexpr int kVotesMost = 16;                    // then all count half: a camera may be set up anew
constexpr int kAssumedDelay = 1;

}  // namespace

// ---- ExposureDelay ----

void ExposureDelay::begin(double ratio, double before) noexcept {
  log_ratio_ = ratio > 0 ? std::log(ratio) : 0;
  if (std::abs(log_ratio_) < kLeastLogRatio || before < kDarkest || before > kBrightest) return give_up();
  log_[0] = std::log(before);
  seen_ = 0;
}

void ExposureDelay::see(std::uint64_t index, double mean) noexcept {
  if (log_ratio_ == 0) return;
  if (index != seen_ || mean < kDarkest || mean > kBrightest) return give_up();  // one was lost
  log_[++seen_] = std::log(mean);
  if (seen_ == kImages) judge();
}

/// The place that splits the images into two groups as even as can be.
void ExposureDelay::judge() noexcept {
  std::size_t best = 0;
  double best_cost = 1e300, best_step = 0;
  for (std::size_t split = 1; split <= static_cast<std::size_t>(kMost) + 1; ++split) {
    const auto middle = log_.begin() + static_cast<std::ptrdiff_t>(split);
    const double before = std::accumulate(log_.begin(), middle, 0.) / static_cast<double>(split);
    const double after = std::accumulate(middle, log_.end(), 0.) / static_cast<double>(log_.size() - split);
    double cost = 0;
    for (std::size_t i = 0; i < log_.size(); ++i) {
      const double off = log_[i] - (i < split ? before : after);
      cost += off * off;
    }
    if (cost >= best_cost) continue;
    best = split - 1;
    best_cost = cost;
    best_step = after - before;
  }
  // a step of the right sign, of half the size (cameras compress) to twice it, and well above what else goes on
  const double share = best_step / log_ratio_;
  const double rest = std::sqrt(best_cost / static_cast<double>(log_.size()));
  if (share > 0.3 && share < 2 && rest < 0.25 * std::abs(best_step)) ++votes_[best];
  if (std::accumulate(votes_.begin(), votes_.end(), 0) >= kVotesMost)
    for (int& votes : votes_) votes /= 2;
  give_up();
}

int ExposureDelay::delay() const noexcept {
  const auto most = std::max_element(votes_.begin(), votes_.end());
  const int all = std::accumulate(votes_.begin(), votes_.end(), 0);
  return *most >= kVotes && 3 * *most >= 2 * all ? static_cast<int>(most - votes_.begin()) : -1;
}

// ---- ExposureTimeline ----

void ExposureTimeline::begin(const ExposureState& state) noexcept {
  current_ = state;
  changes_.clear();
  settled_from_ = 0;
  any_ = false;
  is_learning_ = false;
  learned_.give_up();
}

void ExposureTimeline::change(HostStamp at, const ExposureState& state) noexcept {
  if (changes_.full()) {  // nobody reads images: only the last counts
    changes_.clear();
    current_ = state;
  }
  changes_.push_back({at, state, 0, false});
}

int ExposureTimeline::delay() const noexcept {
  if (known_delay_ >= 0) return known_delay_;
  return learned_.delay() >= 0 ? learned_.delay() : kAssumedDelay;
}

/// Lost images count: they are thought to lie evenly between their neighbours.
void ExposureTimeline::number_changes(HostStamp stamp, std::uint64_t sequence) noexcept {
  for (Change& change : changes_) {
    if (change.is_numbered || change.at >= stamp) continue;
    const std::uint64_t step = any_ ? sequence - sequence_ : 1;
    const auto apart = static_cast<double>((stamp - stamp_).ns);
    const double part = any_ && change.at > stamp_ ? static_cast<double>((change.at - stamp_).ns) / apart : 0;
    const auto passed = static_cast<std::uint64_t>(part * static_cast<double>(step));
    change.first = sequence - step + 1 + std::min(passed, step - 1);
    change.is_numbered = true;
    // a change that is not known to show yet hides when it will: wait for the slowest camera
    const int wait = is_delay_known() ? delay() + 1 : ExposureDelay::kMost + 1;
    settled_from_ = std::max(settled_from_, change.first + static_cast<std::uint64_t>(wait));
    const ExposureState& before = &change == changes_.begin() ? current_ : (&change - 1)->state;
    is_learning_ = known_delay_ < 0 && any_ && changes_.size() == 1 && sequence == change.first;
    learning_first_ = change.first;
    if (is_learning_) learned_.begin(change.state.total() / before.total(), mean_);
    if (!is_learning_) learned_.give_up();
  }
}

ExposureTimeline::OfImage ExposureTimeline::image(HostStamp stamp, std::uint64_t sequence) noexcept {
  number_changes(stamp, sequence);
  const auto delay_now = static_cast<std::uint64_t>(delay());
  std::size_t shown = 0;
  while (shown < changes_.size() && changes_[shown].is_numbered && sequence >= changes_[shown].first + delay_now)
    current_ = changes_[shown++].state;
  if (shown > 0) {
    for (std::size_t i = shown; i < changes_.size(); ++i) changes_[i - shown] = changes_[i];
    changes_.resize(changes_.size() - shown);
  }
  stamp_ = stamp;
  sequence_ = sequence;
  any_ = true;
  return {current_, changes_.empty() && sequence >= settled_from_};
}

void ExposureTimeline::brightness(double mean) noexcept {
  mean_ = mean;
  if (is_learning_) learned_.see(sequence_ - learning_first_, mean);
}

}  // namespace epiline
