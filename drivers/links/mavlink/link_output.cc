// What the link to a flight controller sends, and when.
#include <algorithm>
#include <cmath>
#include <variant>

#include "drivers/links/mavlink/link.h"
#include "drivers/links/mavlink/odometry.h"

namespace epiline::mavlink {

namespace {

constexpr std::int64_t kOrigins_ns = 5'000'000'000;  // one that was started anew has forgotten
constexpr std::size_t kAnythingBehind = 512;         // bytes in the kernel that a frame may wait for

SetGpsGlobalOrigin origin_message(const MavlinkConfig& config, std::int64_t now_ns) {
  SetGpsGlobalOrigin message;
  message.latitude = static_cast<std::int32_t>(std::lround(1e7 * config.origin[0]));
  message.longitude = static_cast<std::int32_t>(std::lround(1e7 * config.origin[1]));
  message.altitude = static_cast<std::int32_t>(std::lround(1e3 * config.origin[2]));
  message.target_system = static_cast<std::uint8_t>(config.system);
  message.time_usec = static_cast<std::uint64_t>(now_ns / 1000);
  return message;
}

/// In the order of the enum.
constexpr struct {
  const char *sentence, *remedy;
} kRefusals[] = {{"", ""},
                 {"PX4 takes mavlink.message = \"vision-position\" for a pose to true north: odometry is not sent",
                  "set mavlink.message = \"odometry\", or mavlink.frame = \"local-ned\" and mavlink.heading_deg"},
                 {"ArduPilot ignores ODOMETRY in mavlink.frame = \"local-ned\": odometry is not sent",
                  "set mavlink.frame = \"local-frd\" and remove mavlink.heading_deg"}};

}  // namespace

const char* sentence_of(Refusal refusal) noexcept { return kRefusals[static_cast<std::size_t>(refusal)].sentence; }
const char* remedy_of(Refusal refusal) noexcept { return kRefusals[static_cast<std::size_t>(refusal)].remedy; }

/// PX4 would move its origin in flight; ArduPilot takes the first one and leaves it at that.
bool MavlinkLink::wants_origin() const noexcept {
  return config_.has_origin() && state_.peer.is_known && state_.peer.autopilot == kArduPilot;
}

/// A frame that the flight controller would misunderstand, or would not take.
Refusal MavlinkLink::refusal() const noexcept {
  const bool is_north = config_.frame == 1, is_odometry = config_.message == 0;
  if (!state_.peer.is_known) return Refusal::kNone;
  if (state_.peer.autopilot == kPx4 && !is_odometry && !is_north) return Refusal::kNeedsHeading;
  if (state_.peer.autopilot == kArduPilot && is_odometry && is_north) return Refusal::kTakesOnlyFrd;
  return Refusal::kNone;
}

/// Poses without a frame of reference wait until it is known whose they would be.
bool MavlinkLink::is_odometry_held() const noexcept {
  const bool waits_for_peer = config_.message != 0 && config_.frame != 1 && !state_.peer.is_known;
  return waits_for_peer || is_paused_ || state_.refusal != Refusal::kNone;
}

std::int64_t MavlinkLink::odometry_due_ns() const noexcept { return is_odometry_held() ? kFar_ns : stream_.due_ns(); }

void MavlinkLink::look_at_estimate(std::int64_t now_ns) noexcept {
  state_.refusal = refusal();
  is_paused_ = now_ns < pause_until_ns_;
  stream_.look(now_ns, state_.is_open && !is_odometry_held());
  if (stream_.has_admitted()) local_frame_.see(stream_.next().odometry, R_VB_);
  const bool is_refused = state_.refusal != Refusal::kNone;
  state_.condition = is_refused ? Condition::kRefused : stream_.condition();
  news_.update(now_ns, state_.condition, stream_.reasons());
  const bool is_held_up = !state_.is_open || is_frame_waiting() || backlog_ > kOdometryBehind;
  stream_.count_dropped(now_ns, is_held_up && !is_odometry_held());
}

/// Frames are made at the last moment, one at a time: what waits is always the newest.
void MavlinkLink::write_port() noexcept {
  while (flush() && state_.is_open) {
    backlog_ = port_->backlog();
    if (!compose(system_.now_ns())) return;
  }
}

/// True: nothing is left of the last frame.
bool MavlinkLink::flush() noexcept {
  if (!is_frame_waiting()) return true;
  const PortResult result = port_->write(frame_.bytes().subspan(frame_sent_));
  const std::int64_t now_ns = system_.now_ns();
  frame_sent_ += result.bytes;
  if (result.error != 0) {
    ++state_.counts.write_errors;
    state_.counts.last_error = result.error;
    frame_.size = frame_sent_ = 0;  // a datagram nobody took; and a port that is lost takes nothing
    if (result.is_lost) lose(now_ns, result.error);
  } else if (is_frame_waiting()) {
    return false;
  } else if (is_frame_odometry_) {
    stream_.finished(now_ns);
  }
  return true;
}

template <class Message>
void MavlinkLink::put(const Message& message, std::uint64_t& count) noexcept {
  frame_ = frame_of(pack(message, own_, sequence_++), signing_.has_value());
  if (signing_) signing_->sign(frame_, signing_time_now());
  frame_sent_ = 0;
  is_frame_odometry_ = false;
  ++count;
}

std::optional<CommandLong> MavlinkLink::height_question(std::int64_t now_ns) noexcept {
  if (now_ns < heights_due_ns()) return std::nullopt;
  return height_request_->question(*heights_, state_.peer.address, now_ns);
}

std::optional<ControllerSurvey::Question> MavlinkLink::survey_question(std::int64_t now_ns) noexcept {
  if (!state_.peer.is_known) return std::nullopt;
  return survey_.question(state_.peer.address, now_ns);
}

/// The next frame, if there is something to send and the line has room: answers first, for they are timed; then
/// odometry.
bool MavlinkLink::compose(std::int64_t now_ns) noexcept {
  if (backlog_ > kAnythingBehind) return false;
  LinkCounts& counts = state_.counts;
  if (const auto answer = timesync_.answer(now_ns)) {
    put(*answer, counts.timesync_answers);
  } else if (now_ns >= odometry_due_ns() && backlog_ <= kOdometryBehind) {
    put_odometry(now_ns);
  } else if (now_ns >= next_heartbeat_ns_) {
    Heartbeat heartbeat;
    heartbeat.system_status = system_state_of(state_.condition);
    put(heartbeat, counts.heartbeats);
    next_heartbeat_ns_ = now_ns + kSecond_ns;
  } else if (const auto text = news_.take(now_ns)) {
    StatusText message;
    message.severity = text->severity;
    std::copy_n(text->text, message.text.size(), message.text.begin());
    put(message, counts.texts);
  } else if (state_.peer.is_known && now_ns >= next_question_ns_) {
    put(timesync_.question(state_.peer.address, now_ns), counts.timesync_questions);
    next_question_ns_ = now_ns + question_period_ns_;
  } else if (state_.peer.is_known && imu_request_ && now_ns >= imu_request_->due_ns()) {
    put(imu_request_->question(state_.peer.address, now_ns), counts.requests);
  } else if (const auto question = height_question(now_ns)) {
    put(*question, counts.requests);
  } else if (wants_origin() && now_ns >= next_origin_ns_) {
    put(origin_message(config_, now_ns), counts.origins);
    next_origin_ns_ = now_ns + kOrigins_ns;
  } else if (const auto asked = survey_question(now_ns)) {
    std::visit([&](const auto& message) { put(message, counts.questions); }, *asked);
  } else {
    return false;
  }
  return true;
}

void MavlinkLink::put_odometry(std::int64_t now_ns) noexcept {
  const auto send = [&](auto message) {
    message.reset_counter = stream_.reset_counter();
    put(message, state_.counts.odometry);
  };
  if (config_.message == 0) {
    send(odometry_message(stream_.next().odometry, R_VB_, local_frame_));
  } else {
    send(vision_position_message(stream_.next().odometry, R_VB_, local_frame_));
  }
  is_frame_odometry_ = true;
  if (state_.sending_since.ns == 0) state_.sending_since = HostStamp{now_ns};
  last_odometry_ns_ = now_ns;
  stream_.begun(now_ns);
}

}  // namespace epiline::mavlink
