#include "drivers/links/mavlink/controller_survey.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace epiline::mavlink {

namespace {

ParamRequestRead parameter_request(std::string_view parameter, Address to) noexcept {
  ParamRequestRead request;
  request.target_system = to.system;
  request.target_component = to.component;
  std::copy_n(parameter.begin(), std::min(parameter.size(), request.param_id.size()), request.param_id.begin());
  return request;
}

std::string_view parameter_name(const ParameterId& id) noexcept {
  return {id.data(), static_cast<std::size_t>(std::find(id.begin(), id.end(), '\0') - id.begin())};
}

}  // namespace

std::span<const std::string_view> parameters_of(std::uint8_t autopilot) noexcept {
  if (autopilot == kPx4) return kPx4Parameters;
  if (autopilot == kArduPilot) return kArduPilotParameters;
  return {};
}

std::optional<double> ControllerAnswers::parameter(std::string_view name) const noexcept {
  const auto names = parameters_of(autopilot);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  const float value = parameters[static_cast<std::size_t>(found - names.begin())];
  return std::isnan(value) ? std::nullopt : std::optional<double>(value);
}

std::size_t ControllerSurvey::items() const noexcept {
  return kFirstParameter + parameters_of(answers_.autopilot).size();
}

void ControllerSurvey::begin(std::uint8_t autopilot, std::int64_t now_ns) noexcept {
  *this = {};
  answers_.autopilot = autopilot;
  if (parameters_of(autopilot).empty()) return;
  asked_[kOrigin].has_answer = autopilot != kPx4;  // only PX4's matters
  due_ns_ = now_ns;
  status_period_ns_ = kStatusFrom_ns;
}

/// The next one that has no answer. None: nothing can be asked now, and due_ns_ says when.
std::optional<std::size_t> ControllerSurvey::open_item(std::int64_t now_ns) noexcept {
  std::int64_t next_ns = std::numeric_limits<std::int64_t>::max();
  for (std::size_t i = 0; i < items(); ++i) {
    const Item& item = asked_[i];
    if (item.has_answer) continue;
    const std::int64_t from_ns = item.tries == 0 ? now_ns : item.asked_ns + kAgain_ns;
    if (item.tries < kTries && from_ns <= now_ns) return i;
    if (item.tries < kTries || from_ns > now_ns) next_ns = std::min(next_ns, from_ns);
  }
  answers_.is_complete = next_ns == std::numeric_limits<std::int64_t>::max();
  due_ns_ = answers_.is_complete ? now_ns + kLater_ns : next_ns;
  return std::nullopt;
}

ControllerSurvey::Question ControllerSurvey::ask(std::size_t item, Address to, std::int64_t now_ns) noexcept {
  asked_[item].asked_ns = now_ns;
  if (item == kVersion) return command_about(AutopilotVersion::kId, kRequestMessage, to);
  if (item == kOrigin) return command_about(GpsGlobalOrigin::kId, kRequestMessage, to);
  return parameter_request(parameters_of(answers_.autopilot)[item - kFirstParameter], to);
}

std::optional<ControllerSurvey::Question> ControllerSurvey::question(Address to, std::int64_t now_ns) noexcept {
  if (now_ns < due_ns_) return std::nullopt;
  if (answers_.is_complete) return later_question(to, now_ns);
  const auto item = open_item(now_ns);
  if (!item) return std::nullopt;
  ++asked_[*item].tries;
  due_ns_ = now_ns + kBetween_ns;
  return ask(*item, to, now_ns);
}

/// A controller that sends no status is asked ever less often.
std::optional<ControllerSurvey::Question> ControllerSurvey::later_question(Address to, std::int64_t now_ns) noexcept {
  due_ns_ = now_ns + kLater_ns;
  if (now_ns >= next_status_ns_) {
    next_status_ns_ = now_ns + status_period_ns_;
    status_period_ns_ = std::min(2 * status_period_ns_, kStatusTo_ns);
    return command_about(answers_.autopilot == kPx4 ? EstimatorStatus::kId : EkfStatusReport::kId, kRequestMessage, to);
  }
  const auto names = parameters_of(answers_.autopilot);
  for (std::size_t i = 0; i < names.size() && !is_armed_; ++i) {
    repeated_ = (repeated_ + 1) % names.size();
    if (asked_[kFirstParameter + repeated_].has_answer) return ask(kFirstParameter + repeated_, to, now_ns);
  }
  return std::nullopt;
}

void ControllerSurvey::take(const AutopilotVersion& version) noexcept {
  asked_[kVersion].has_answer = true;
  const std::uint32_t bits = version.flight_sw_version;
  answers_.version = static_cast<std::uint16_t>(100 * (bits >> 24U) + (bits >> 16U & 0xffU));
}

/// PX4 sends the bits of its integers, ArduPilot their values.
void ControllerSurvey::take(const ParamValue& value) noexcept {
  const auto names = parameters_of(answers_.autopilot);
  const auto found = std::find(names.begin(), names.end(), parameter_name(value.param_id));
  if (found == names.end()) return;
  const auto i = static_cast<std::size_t>(found - names.begin());
  std::int32_t integer = 0;
  std::memcpy(&integer, &value.param_value, sizeof integer);
  constexpr std::uint8_t kFloat = 9;  // MAV_PARAM_TYPE
  constexpr float kLargest = 1e9F;    // none of those that are asked for is near it
  const bool is_bits = answers_.autopilot == kPx4 && value.param_type != kFloat;
  const float number = is_bits ? static_cast<float>(integer) : value.param_value;
  answers_.parameters[i] = std::abs(number) < kLargest ? number : std::numeric_limits<float>::quiet_NaN();
  asked_[kFirstParameter + i].has_answer = true;
}

bool ControllerSurvey::receive(const Packet& packet, std::int64_t now_ns) noexcept {
  FilterStatus& filter = answers_.filter;
  const auto status_came = [&] {
    filter.at = HostStamp{now_ns};
    status_period_ns_ = kStatusFrom_ns;
    next_status_ns_ = now_ns + kStatusFrom_ns;
  };
  AutopilotVersion version;
  ParamValue value;
  GpsGlobalOrigin origin;
  EkfStatusReport report;
  EstimatorStatus status;
  EstimatorSensorFusionStatus fusion;
  if (unpack(packet, version)) {
    take(version);
  } else if (unpack(packet, value)) {
    take(value);
  } else if (unpack(packet, origin)) {
    asked_[kOrigin].has_answer = true;
  } else if (unpack(packet, report)) {
    filter.flags = report.flags;
    status_came();
  } else if (unpack(packet, status)) {
    filter.velocity = status.vel_ratio;
    filter.position = status.pos_horiz_ratio;
    filter.height = status.pos_vert_ratio;
    filter.heading = status.mag_ratio;
    status_came();
  } else if (unpack(packet, fusion)) {
    filter.vision_intended = static_cast<std::int8_t>(fusion.intended[fusion.kVision] != 0);
    filter.vision_active = static_cast<std::int8_t>(fusion.active[fusion.kVision] != 0);
  } else {
    return false;
  }
  return true;
}

}  // namespace epiline::mavlink
