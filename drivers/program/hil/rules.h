#pragma once
// What flight controllers ask of visual odometry, rule by rule, and what became of each rule in a run. Page:
// docs/hil.md.
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
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
  kStatusText,
  kOrigin,
  kCanFrames,
  kCanStatus,
  kCount,
};
inline constexpr std::size_t kRules = static_cast<std::size_t>(Rule::kCount);

enum class Controller : std::uint8_t { kPx4, kArdupilot };
inline constexpr const char* kControllerNames[] = {"PX4", "ArduPilot"};

struct RuleInfo {
  const char* name;    ///< short, as in reports
  const char* demand;  ///< in words
  const char* source;  ///< where a controller's program says so
  bool px4, ardupilot;
  bool asks(Controller controller) const { return controller == Controller::kPx4 ? px4 : ardupilot; }
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
  bool accepted_by(Controller controller) const;
  bool accepted() const { return accepted_by(Controller::kPx4) && accepted_by(Controller::kArdupilot); }
  /// Those broken, in their order.
  std::vector<Rule> broken() const;
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

/// The verdict for people: a line for each rule, those broken first with what was found, times since `begin`.
std::string text_of(const Verdict& verdict, HostStamp begin);

}  // namespace epiline::hil
