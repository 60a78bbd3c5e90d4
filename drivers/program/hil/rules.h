#pragma once
// What flight controllers ask of visual odometry, rule by rule, and what became of each rule in a run. Page:
// docs/hil.md.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

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

/// A release of a flight controller's program, as the user names it.
struct Release {
  const char* option;  ///< of --judge
  const char* name;
};
inline constexpr Release kReleases[] = {
    {"px4-1.14", "PX4 1.14"},
    {"px4-1.15", "PX4 1.15"},
    {"px4-1.16", "PX4 1.16"},
    {"px4-main", "PX4 main"},
    {"px4-spring-2026", "PX4 main of 27 February to 18 May 2026"},
    {"ardupilot-4.5", "ArduPilot 4.5"},
    {"ardupilot-4.6", "ArduPilot 4.6"},
    {"ardupilot-4.7", "ArduPilot 4.7"},
};
/// A set of them: bit i stands for kReleases[i].
using Releases = unsigned;
inline constexpr Releases kPx4Spring2026 = 0b0001'0000, kPx4Before27342 = 0b0001'0111, kPx4Since27342 = 0b0000'1000;
inline constexpr Releases kEveryPx4 = 0b0001'1111, kEveryArdupilot = 0b1110'0000, kEveryRelease = 0b1111'1111;
/// Those that are judged unless others are named: all but the builds of a spring.
inline constexpr Releases kUsualReleases = kEveryRelease & ~kPx4Spring2026;
/// What the words name, separated by commas: options of kReleases, `px4` and `ardupilot` for the usual ones of each,
/// `all` for every one. None: a word is unknown, or there is none.
std::optional<Releases> releases_from(std::string_view words);

struct RuleInfo {
  const char* name;    ///< short, as in reports
  const char* demand;  ///< in words
  const char* source;  ///< where a controller's program says so
  Releases releases;   ///< that ask for it
};
const RuleInfo& info_of(Rule rule);

enum class RuleState : std::uint8_t {
  kNotSeen,  ///< nothing that the rule speaks of has happened
  kKept,
  kBroken,
};
inline constexpr const char* kRuleStateNames[] = {"not seen", "kept", "BROKEN"};

struct RuleVerdict {
  Rule rule = Rule::kFusion;
  RuleState state = RuleState::kNotSeen;
  std::uint64_t checked = 0, broken = 0;  ///< occasions
  HostStamp first_at;                     ///< of the first time it was broken, and what was found then
  std::string first;
  std::string figure;  ///< the measured quantity, whether kept or not; may be empty
};

struct Verdict {
  std::array<RuleVerdict, kRules> rules;
  const RuleVerdict& of(Rule rule) const { return rules[static_cast<std::size_t>(rule)]; }
  /// By each of them.
  bool accepted_by(Releases releases) const { return broken(releases).empty(); }
  /// The rules of these releases that are broken, in their order.
  std::vector<Rule> broken(Releases releases = kUsualReleases) const;
};

/// Counts what rules are asked and how often they are broken, and keeps the first instance. Fixed memory but for that.
class RuleBook {
 public:
  RuleBook();
  /// `what()` says what was found; called for the first instance only.
  template <class What>
  bool judge(Rule rule, bool good, HostStamp at, What&& what) {
    RuleVerdict& v = verdict_.rules[static_cast<std::size_t>(rule)];
    ++v.checked;
    if (good) return true;
    if (v.broken++ == 0) v.first = std::forward<What>(what)(), v.first_at = at;
    return false;
  }
  void figure(Rule rule, std::string text) { verdict_.rules[static_cast<std::size_t>(rule)].figure = std::move(text); }
  Verdict verdict() const;

 private:
  Verdict verdict_;
};

/// The verdict for people: a line for each rule of these releases, those broken first with what was found, times since
/// `begin`; and a line for each release.
std::string text_of(const Verdict& verdict, HostStamp begin, Releases releases = kUsualReleases);

}  // namespace epiline::hil
