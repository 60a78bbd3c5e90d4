#pragma once
// What to skip when time is short, and when to resume it. docs/developers/realtime.md, "When time is short".
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>

#include "estimator/estimator.h"
#include "platform/log/event.h"

namespace epiline {

/// In the order in which work is skipped.
enum class LoadLevel : std::uint8_t { kFull, kFewerFeatures, kFewerIterations, kPredictionOnly, kCount };
constexpr std::size_t kLoadLevels = static_cast<std::size_t>(LoadLevel::kCount);
static_assert(std::size(kLoadLevelNames) == kLoadLevels);

/// The second largest of the last few measurements, so that one stray value does not count.
class RecentMost {
 public:
  void add(double value) noexcept {
    values_[next_++ % kKept] = value;
    if (count_ < kKept) ++count_;
  }
  double get() const noexcept;  ///< 0: none yet

 private:
  static constexpr std::size_t kKept = 8;
  std::array<double, kKept> values_{};
  std::size_t next_ = 0, count_ = 0;
};

/// Chooses the effort of each solve so that it fits into the available time. It has no clock; the caller passes times.
///
/// It learns the cost of a solve as the time of one track in one linearisation, and how often a solve linearises; the
/// fixed parts count as a number of tracks. When time is short it takes the first rung that fits, at once. It takes a
/// better one after that one has fitted with room to spare at several frames in a row.
class LoadGovernor {
 public:
  static constexpr std::int64_t kUnlimited = std::numeric_limits<std::int64_t>::max();

  struct Plan {
    LoadLevel level = LoadLevel::kFull;
    Supervisor::Effort effort;
  };
  struct Counts {
    std::array<std::uint64_t, kLoadLevels> frames{};  ///< due for a solve, by the level they were planned at
    std::uint64_t lowered = 0, raised = 0;            ///< how often effort was lowered and raised
    std::uint64_t let_through = 0;  ///< frames of prediction only that were solved, so that the estimate survives
    std::uint64_t over_budget = 0;  ///< solves that took longer than they should have
  };

  /// For a frame due to be solved: `budget_ns` for its solve; kUnlimited: as long as it takes. `saves`: what a
  /// predicted frame does not use is saved for a later solve that takes longer; otherwise the budget ends at a hard
  /// deadline.
  Plan plan(HostStamp frame, std::int64_t budget_ns, bool saves) noexcept;
  /// After the solve of that frame: its time, the tracks the window had to offer and those used, and how often the
  /// problem was linearised.
  void took(std::int64_t solve_ns, int offered, int used, int linearisations) noexcept;

  const Counts& counts() const noexcept { return counts_; }
  LoadLevel level() const noexcept;

 private:
  int first_that_fits(double budget_ns, double room) const noexcept;
  double cost_ns(int rung) const noexcept;
  Plan plan_of(int rung) const noexcept;
  bool let_through(HostStamp frame, bool saves) noexcept;

  RecentMost unit_ns_;         ///< of a track in a linearisation
  RecentMost linearisations_;  ///< of a solve; those of a single step let older ones be forgotten
  int offered_ = 0;            ///< tracks in the window
  int rung_ = 0;
  int calm_ = 0, calm_rung_ = 0;  ///< frames in a row that a better rung would fit, and the best rung that fits all
  bool any_solved_ = false;
  HostStamp last_solved_;
  std::int64_t budget_ns_ = kUnlimited;
  double saved_ns_ = 0;
  Counts counts_;
};

}  // namespace epiline
