// What the link to a flight controller receives, and from whom.
#include <utility>

#include "drivers/links/mavlink/link.h"

namespace epiline::mavlink {

namespace {

constexpr std::int64_t kPeerGone_ns = 5'000'000'000;  // another flight controller may take its place
constexpr std::int64_t kPeerAway_ns = 2'500'000'000;  // two heartbeats were missing: it may have started anew
constexpr std::int64_t kSureMayCome_ns =
    3'000'000'000;                                     // heartbeats come once a second: an autopilot was heard by then
constexpr std::int64_t kOriginPause_ns = 600'000'000;  // PX4 stops fusing after 400 ms

/// MAV_TYPE of what flies or drives with a vehicle: companion, gimbal, ADS-B, camera, charger and so on. Some of them
/// claim an autopilot in their heartbeats.
bool is_on_board_of_another(std::uint8_t type) noexcept {
  return type == 18 || type == 26 || type == 27 || (type >= 30 && type <= 34) || (type >= 36 && type <= 42) ||
         type == 44;
}

}  // namespace

void MavlinkLink::receive(const Packet& packet, std::int64_t now_ns) noexcept {
  if (packet.from == own_) return;  // our echo
  const LinkPeer& peer = state_.peer;
  const bool is_autopilot = peer.is_known && packet.from == peer.address;
  if (packet.id == Heartbeat::kId) return receive_heartbeat(packet, now_ns);
  Timesync timesync;
  if (unpack(packet, timesync)) return timesync_.receive(timesync, packet.from, is_autopilot, now_ns);
  if (ControllerHeight::is_mine(packet)) {
    if (!heights_) return;
    if (!is_autopilot) return static_cast<void>(++state_.counts.strangers);
    return receive_height(packet, now_ns);
  }
  GpsGlobalOrigin origin;
  if (is_autopilot && unpack(packet, origin)) receive_origin(origin, now_ns);
  if (is_autopilot && survey_.receive(packet, now_ns)) return;
  HighresImu highres;
  RawImu raw;
  CommandAck answer;
  const bool is_highres = unpack(packet, highres), is_raw = unpack(packet, raw), is_answer = unpack(packet, answer);
  if (!imu_ || !(is_highres || is_raw || is_answer)) return;
  if (!is_autopilot) {
    ++state_.counts.strangers;
  } else if (is_answer) {
    imu_request_->receive(answer, own_, now_ns);
  } else if (is_highres) {
    receive_reading(highres, now_ns);
  } else if (peer.autopilot == kArduPilot) {
    receive_reading(raw, now_ns);
  }
}

template <class Message>
void MavlinkLink::receive_reading(const Message& message, std::int64_t now_ns) noexcept {
  ImuSample sample;
  if (!imu_->take(message, timesync_.clock(), HostStamp{now_ns}, sample)) return;
  imu_request_->reading(now_ns);
  if (!has_reader_.load(std::memory_order_relaxed)) return;
  if (!readings_.push(sample)) imu_->count_overrun();
  readings_parking_.notify();
}

void MavlinkLink::receive_height(const Packet& packet, std::int64_t now_ns) noexcept {
  HeightSample sample;
  if (!heights_->take(packet, timesync_.clock(), HostStamp{now_ns}, sample)) return;
  if (!has_height_reader_.load(std::memory_order_relaxed)) return;
  if (!heights_read_.push(sample)) heights_->count_overrun();
  heights_parking_.notify();
}

/// When to ask for heights. An answer does not say to which question: those of the IMU come first.
std::int64_t MavlinkLink::heights_due_ns() const noexcept {
  if (!state_.peer.is_known || !height_request_) return kFar_ns;
  const bool waits = imu_request_ && imu_request_->state() != RequestState::kAccepted;
  return waits ? kFar_ns : height_request_->due_ns();
}

/// A flight controller is component 1, and its type is that of a vehicle. Any other is taken only if none such is heard
/// for some seconds, and gives way to one at once.
void MavlinkLink::receive_heartbeat(const Packet& packet, std::int64_t now_ns) noexcept {
  constexpr std::uint8_t kNoAutopilot = 8, kGroundStation = 6, kArmed = 128;
  Heartbeat heartbeat;
  unpack(packet, heartbeat);
  if (packet.from.system != own_.system || heartbeat.autopilot == kNoAutopilot || heartbeat.type == kGroundStation)
    return;
  LinkPeer& peer = state_.peer;
  const auto is_sure = [](Address from, std::uint8_t type) {
    return from.component == 1 && !is_on_board_of_another(type);
  };
  const bool is_same = peer.is_known && packet.from.component == peer.address.component;
  const bool is_sure_now = is_sure(packet.from, heartbeat.type),
             was_sure = peer.is_known && is_sure(peer.address, peer.type);
  const bool is_gone = now_ns - peer.last_heard.ns >= kPeerGone_ns;
  if (doubtful_since_ns_ == 0) doubtful_since_ns_ = now_ns;
  const bool may_come = peer.is_known ? is_sure_now > was_sure || (is_sure_now == was_sure && is_gone)
                                      : is_sure_now || now_ns - doubtful_since_ns_ >= kSureMayCome_ns;
  if (!is_same && !may_come) {
    if (!is_on_board_of_another(heartbeat.type)) ++state_.counts.strangers;  // a camera beside a controller is no fault
    return;
  }
  const bool was_away = now_ns - peer.last_heard.ns >= kPeerAway_ns || peer.last_heard.ns < opened_ns_;
  const bool begins = !is_same || was_away || heartbeat.autopilot != peer.autopilot;
  peer = {true, packet.from, heartbeat.autopilot, heartbeat.type, HostStamp{now_ns}};
  if (begins) begin_with_peer(now_ns);
  survey_.set_armed((heartbeat.base_mode & kArmed) != 0);
}

/// Of another controller, or one that has started anew, nothing is known, and it knows nothing of what was asked.
void MavlinkLink::begin_with_peer(std::int64_t now_ns) noexcept {
  survey_.begin(state_.peer.autopilot, now_ns);
  has_origin_ = false;
  next_question_ns_ = now_ns;
  if (imu_request_) imu_request_->restart();
}

/// PX4 from 1.18 on loses its position at the first origin while it fuses vision, unless vision pauses. The frame it
/// takes for its own map (LOCAL_FRD with all of EKF2_EV_CTRL) is not affected.
void MavlinkLink::receive_origin(const GpsGlobalOrigin& origin, std::int64_t now_ns) noexcept {
  constexpr double kAll = 15;
  const ControllerAnswers& answers = survey_.answers();
  const bool is_as_before = origin_ && origin_->latitude == origin.latitude && origin_->longitude == origin.longitude &&
                            origin_->time_usec == origin.time_usec;
  origin_ = origin;
  if (std::exchange(has_origin_, true) || is_as_before || state_.peer.autopilot != kPx4) return;
  const ControllerRelease* const release = answers.release();
  const bool is_sound = release != nullptr && !release->loses_position_at_origin;
  const bool is_its_map = config_.message == 0 && config_.frame != 1 && answers.parameter("EKF2_EV_CTRL") == kAll;
  if (is_sound || is_its_map || state_.sending_since.ns == 0) return;
  pause_until_ns_ = now_ns + kOriginPause_ns;
  ++state_.counts.origin_pauses;
}

}  // namespace epiline::mavlink
