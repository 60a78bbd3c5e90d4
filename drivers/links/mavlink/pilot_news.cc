#include "drivers/links/mavlink/pilot_news.h"

#include <algorithm>
#include <cstdio>
#include <limits>

namespace epiline::mavlink {

namespace {

constexpr std::int64_t kBetweenTexts_ns = 1'000'000'000, kLasting_ns = 500'000'000;

struct Words {
  HealthReason reason;
  const char* words;
};
/// The first that holds is told: causes before what follows from them.
constexpr Words kWords[] = {
    {HealthReason::kCameraSilent, "no camera images"},
    {HealthReason::kImuSilent, "no IMU data"},
    {HealthReason::kLensCovered, "lens covered"},
    {HealthReason::kImagesFrozen, "camera image frozen"},
    {HealthReason::kImuStuck, "IMU stuck"},
    {HealthReason::kImuSaturated, "IMU at its limit"},
    {HealthReason::kNumbersWrong, "calibration or units wrong"},
    {HealthReason::kOverloaded, "computer overloaded"},
    {HealthReason::kDeadlineMissed, "computer overloaded"},
    {HealthReason::kViewObstructed, "view blocked"},
    {HealthReason::kFewTracks, "too little to see"},
    {HealthReason::kManyGated, "view disagrees with IMU"},
    {HealthReason::kImuGap, "IMU data missing"},
    {HealthReason::kCameraClockJump, "camera clock jumped"},
    {HealthReason::kImuClockJump, "IMU clock jumped"},
    {HealthReason::kImuClockDrift, "IMU clock drifts"},
    {HealthReason::kReadingsRefused, "bad IMU data"},
    {HealthReason::kBiasImplausible, "IMU bias implausible"},
    {HealthReason::kScaleUnknown, "scale unknown"},
    {HealthReason::kStepsRejected, "no solution"},
    {HealthReason::kNotFinite, "no solution"},
    {HealthReason::kExposureStep, "brightness jumped"},
    {HealthReason::kPosteriorWide, "not certain yet"},
};

const char* words_of(std::uint32_t reasons) noexcept {
  for (const Words& w : kWords)
    if ((reasons & bit(w.reason)) != 0) return w.words;
  return "estimate uncertain";
}

bool is_stop(Condition condition) noexcept { return condition == Condition::kLost || condition == Condition::kSilent; }

}  // namespace

std::uint8_t system_state_of(Condition condition) noexcept {
  constexpr std::uint8_t kStandby = 3, kActive = 4, kCritical = 5;
  if (is_stop(condition)) return kCritical;
  return condition == Condition::kWaiting || condition == Condition::kRefused ? kStandby : kActive;
}

void PilotNews::update(std::int64_t now_ns, Condition condition, std::uint32_t reasons) noexcept {
  reasons_ = reasons;
  if (condition == now_) return;
  now_ = condition;
  since_ns_ = now_ns;
}

std::int64_t PilotNews::due_ns() const noexcept {
  if (told_ == now_) return std::numeric_limits<std::int64_t>::max();
  const std::int64_t lasting = is_stop(now_) || !told_ ? since_ns_ : since_ns_ + kLasting_ns;
  return std::max(lasting, last_told_ns_ + kBetweenTexts_ns);
}

std::optional<PilotText> PilotNews::take(std::int64_t now_ns) noexcept {
  if (now_ns < due_ns()) return std::nullopt;
  const PilotText text = pilot_text(now_, reasons_, was_lost_);
  was_lost_ = is_stop(now_) || (was_lost_ && now_ == Condition::kWaiting);
  told_ = now_;
  last_told_ns_ = now_ns;
  return text;
}

PilotText pilot_text(Condition condition, std::uint32_t reasons, bool resumed) noexcept {
  constexpr std::uint8_t kCritical = 2, kWarning = 4, kInfo = 6;
  PilotText text;
  const auto say = [&](std::uint8_t severity, const char* format, const char* words) {
    text.severity = severity;
    std::snprintf(text.text, sizeof text.text, format, words);
  };
  switch (condition) {
    case Condition::kWaiting:
      say(kInfo, "VIO starting, no position yet%s", "");
      break;
    case Condition::kGood:
      say(kInfo, resumed ? "VIO ok again, position was reset%s" : "VIO ok%s", "");
      break;
    case Condition::kDegraded:
      say(kWarning, "VIO degraded: %s", words_of(reasons));
      break;
    case Condition::kLost:
      say(kCritical, "VIO lost, stopped: %s", words_of(reasons));
      break;
    case Condition::kSilent:
      say(kCritical, "VIO stopped: no estimate%s", "");
      break;
    case Condition::kRefused:
      say(kCritical, "VIO not sent: %s", "see mavlink.frame of epiline");
      break;
  }
  return text;
}

}  // namespace epiline::mavlink
