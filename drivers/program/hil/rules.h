#pragma once
// The rules that flight controllers impose on visual odometry, and the outcome of each rule in a run. Page:
// docs/hil.md.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/links/mavlink/controller_release.h"
#include "platform/time/clock.h"

namespace epiline::hil {

enum class Rule : std::uint8_t {
  kFusion,
  kFramesPx4,
  kFramesArdupilot,
  kEstimatorType,
  kFinite,
  kCovariance,
  kQuality,
  kSilence,
  kStamps,
  kRate,
  kFlood,
  kRateArdupilot,
  kGapStart,
  kGapStop,
  kGapArdupilot,
  kLatencyPx4,
  kLatencyArdupilot,
  kTimesyncAnswers,
  kTimesyncConvergence,
  kHeartbeat,
  kAddress,
  kSequence,
  kResetCounter,
  kVelocity,
  kInnovation,
  kArming,
  kTurnPx4Before27342,
  kTurnPx4,
  kTurnArdupilot,
  kStatusText,
  kOrigin,
  kCanFrames,
  kCanStatus,
  kCount,
};
inline constexpr std::size_t kRules = static_cast<std::size_t>(Rule::kCount);

using mavlink::Releases;
inline constexpr Releases kPx4Spring2026 =
    mavlink::releases_where([](const auto& r) { return r.arms_with_north_only; });
inline constexpr Releases kPx4Before27342 = mavlink::releases_where([](const auto& r) { return r.squares_yaw_noise; });
inline constexpr Releases kEveryPx4 =
    mavlink::releases_where([](const auto& r) { return r.autopilot == mavlink::kPx4; });
inline constexpr Releases kPx4Since27342 = kEveryPx4 & ~kPx4Before27342;
inline constexpr Releases kEveryArdupilot =
    mavlink::releases_where([](const auto& r) { return r.autopilot == mavlink::kArduPilot; });
inline constexpr Releases kEveryRelease = kEveryPx4 | kEveryArdupilot;
/// The releases that are judged by default: all except the development builds of spring 2026.
inline constexpr Releases kUsualReleases = kEveryRelease & ~kPx4Spring2026;
/// Their names, separated by commas, as the options take them.
std::string release_options();
/// Parses a comma-separated list of release options. `px4` and `ardupilot` stand for the default releases of each,
/// `all` for every release. None: the list is empty or holds an unknown word.
std::optional<Releases> releases_from(std::string_view words);

struct RuleInfo {
  const char* name;    ///< short, as in reports
  const char* demand;  ///< in words
  const char* source;  ///< the place in the controller's source code
  Releases releases;   ///< that impose it
};
const RuleInfo& info_of(Rule rule);

enum class RuleState : std::uint8_t {
  kNotSeen,  ///< the run gave no occasion to check the rule
  kKept,
  kBroken,
};
inline constexpr const char* kRuleStateNames[] = {"not seen", "kept", "BROKEN"};

struct RuleVerdict {
  Rule rule = Rule::kFusion;
  std::uint64_t checked = 0, broken = 0;  ///< occasions
  HostStamp first_at;                     ///< of the first time it was broken, and what was found then
  std::string first;
  std::string figure;  ///< the measured quantity, whether kept or not; may be empty
  RuleState state() const {
    return broken > 0 ? RuleState::kBroken : checked > 0 ? RuleState::kKept : RuleState::kNotSeen;
  }
};

struct Verdict {
  std::array<RuleVerdict, kRules> rules;
  const RuleVerdict& of(Rule rule) const { return rules[static_cast<std::size_t>(rule)]; }
  /// True if none of these releases has a broken rule.
  bool accepted_by(Releases releases) const { return broken(releases).empty(); }
  /// The broken rules of these releases, in the order of Rule.
  std::vector<Rule> broken(Releases releases = kUsualReleases) const;
};

/// Counts how often each rule was checked and broken, and describes its first violation. Fixed memory except for texts.
class RuleBook {
 public:
  RuleBook();
  /// Counts one check at time `at` and returns `good`. `what()` describes a violation; called for a rule's first one
  /// only.
  template <class What>
  bool judge(Rule rule, bool good, HostStamp at, What&& what) {
    RuleVerdict& v = verdict_.rules[static_cast<std::size_t>(rule)];
    ++v.checked;
    if (good) return true;
    if (v.broken++ == 0) v.first = std::forward<What>(what)(), v.first_at = at;
    return false;
  }
  void figure(Rule rule, std::string text) { verdict_.rules[static_cast<std::size_t>(rule)].figure = std::move(text); }
  const Verdict& verdict() const { return verdict_; }

 private:
  Verdict verdict_;
};

/// The verdict as text: a line for each rule of these releases, the broken ones first with their first violation, then
/// a line for each release. Times count from `begin`.
std::string text_of(const Verdict& verdict, HostStamp begin, Releases releases = kUsualReleases);

}  // namespace epiline::hil
