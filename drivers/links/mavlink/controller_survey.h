#pragma once
// Asks a flight controller for its release, its parameters, and what its filter makes of the odometry. Reads, and never
// writes a parameter. Page: docs/flight-controller.md#what-the-controller-is-asked.
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <variant>

#include "drivers/links/mavlink/controller_release.h"
#include "drivers/links/mavlink/message.h"
#include "drivers/links/mavlink/packet.h"
#include "platform/time/clock.h"

namespace epiline::mavlink {

inline constexpr std::array<std::string_view, 12> kPx4Parameters{
    "EKF2_EN",       "EKF2_EV_CTRL",   "EKF2_SENS_EN", "EKF2_EV_QMIN",  "EKF2_EV_NOISE_MD", "EKF2_EVA_NOISE",
    "EKF2_EV_DELAY", "EKF2_DELAY_MAX", "EKF2_HGT_REF", "EKF2_GPS_CTRL", "EKF2_MAG_TYPE",    "SYS_HAS_MAG"};
inline constexpr std::array<std::string_view, 15> kArduPilotParameters{
    "AHRS_EKF_TYPE", "EK3_ENABLE",     "VISO_TYPE",      "VISO_ORIENT",   "VISO_SCALE",
    "VISO_QUAL_MIN", "EK3_SRC1_POSXY", "EK3_SRC1_VELXY", "EK3_SRC1_POSZ", "EK3_SRC1_VELZ",
    "EK3_SRC1_YAW",  "COMPASS_ENABLE", "GPS1_TYPE",      "GPS_TYPE",      "VISO_DELAY_MS"};
inline constexpr std::size_t kMostParameters = 16;
static_assert(kPx4Parameters.size() <= kMostParameters && kArduPilotParameters.size() <= kMostParameters);
/// Empty: of no controller that epiline knows.
std::span<const std::string_view> parameters_of(std::uint8_t autopilot) noexcept;

/// What the filter says of itself. Ratios are those of innovation to gate; not a number: nothing of it is fused.
struct FilterStatus {
  HostStamp at;                                               ///< of the newest message; zero: none came
  float velocity = 0, position = 0, height = 0, heading = 0;  ///< PX4's
  std::uint16_t flags = 0;                                    ///< ArduPilot's EKF_STATUS_FLAGS
  std::int8_t vision_intended = -1, vision_active = -1;       ///< PX4's from 1.18 on; -1: it did not say
};

struct ControllerAnswers {
  std::uint8_t autopilot = 0;                              ///< MAV_AUTOPILOT
  bool is_complete = false;                                ///< each question has its answer, or was asked three times
  std::uint16_t version = 0;                               ///< 100 major + minor; 0: it did not say
  std::array<float, kMostParameters> parameters = none();  ///< as parameters_of() names them; not a number: no answer
  FilterStatus filter;

  std::optional<double> parameter(std::string_view name) const noexcept;
  const ControllerRelease* release() const noexcept { return release_of(autopilot, version); }
  static constexpr std::array<float, kMostParameters> none() noexcept {
    std::array<float, kMostParameters> all{};
    all.fill(std::numeric_limits<float>::quiet_NaN());
    return all;
  }
};

/// Twenty questions a second at most, each three times at most. Then one every two seconds: for the filter's status if
/// it does not come by itself, and while the vehicle is disarmed for a parameter again, because its user may be setting
/// it. Times are monotonic_ns().
class ControllerSurvey {
 public:
  using Question = std::variant<CommandLong, ParamRequestRead>;

  /// A controller is there, or has started anew: forgets all answers.
  void begin(std::uint8_t autopilot, std::int64_t now_ns) noexcept;
  void set_armed(bool is_armed) noexcept { is_armed_ = is_armed; }
  /// When to call question() again; far away before begin().
  std::int64_t due_ns() const noexcept { return due_ns_; }
  std::optional<Question> question(Address to, std::int64_t now_ns) noexcept;
  /// True: it was an answer, asked for or not.
  bool receive(const Packet& packet, std::int64_t now_ns) noexcept;

  const ControllerAnswers& answers() const noexcept { return answers_; }

 private:
  static constexpr std::size_t kVersion = 0, kOrigin = 1, kFirstParameter = 2;
  static constexpr std::int64_t kMs = 1'000'000;
  static constexpr std::int64_t kBetween_ns = 50 * kMs;  ///< ArduPilot keeps 20 questions, and works off one at a time
  static constexpr std::int64_t kAgain_ns = 500 * kMs, kLater_ns = 2000 * kMs;
  static constexpr std::int64_t kStatusFrom_ns = 2000 * kMs, kStatusTo_ns = 32'000 * kMs;
  static constexpr std::uint8_t kTries = 3;
  struct Item {
    bool has_answer = false;
    std::uint8_t tries = 0;
    std::int64_t asked_ns = 0;
  };

  std::size_t items() const noexcept;
  Question ask(std::size_t item, Address to, std::int64_t now_ns) noexcept;
  std::optional<std::size_t> open_item(std::int64_t now_ns) noexcept;
  std::optional<Question> later_question(Address to, std::int64_t now_ns) noexcept;
  void take(const ParamValue& value) noexcept;
  void take(const AutopilotVersion& version) noexcept;

  ControllerAnswers answers_;
  std::array<Item, kFirstParameter + kMostParameters> asked_{};
  std::int64_t due_ns_ = std::numeric_limits<std::int64_t>::max();
  std::int64_t status_period_ns_ = 0, next_status_ns_ = 0;
  std::size_t repeated_ = 0;
  bool is_armed_ = false;
};

}  // namespace epiline::mavlink
