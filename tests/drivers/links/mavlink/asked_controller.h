#pragma once
// A flight controller that answers questions, as PX4's and ArduPilot's own source says: controller_facts.md.
#include <algorithm>
#include <cstring>
#include <map>
#include <set>
#include <string>

#include "drivers/links/mavlink/message.h"
#include "tests/drivers/links/mavlink/link_peer.h"

namespace epiline::mavlink {

class AskedController {
 public:
  static constexpr std::uint8_t kIsPx4 = 12, kIsArduPilot = 3;

  AskedController(Peer& peer, std::uint8_t autopilot, std::array<unsigned, 3> version)
      : peer_(peer), autopilot_(autopilot), version_(version) {}

  std::map<std::string, double> parameters;
  std::set<std::string> is_float{"EKF2_EVA_NOISE", "EKF2_EV_DELAY", "EKF2_DELAY_MAX", "VISO_SCALE"};
  bool is_silent = false;  ///< answers nothing, and sends no heartbeat
  bool has_origin = false;
  std::uint8_t base_mode = 0;
  std::int64_t booted_ns = 0;  ///< its clock began then
  double imu_hz = 0;           ///< as asked for by SET_MESSAGE_INTERVAL

  void heartbeat() {
    if (!is_silent) peer_.send(Heartbeat{.type = 2, .autopilot = autopilot_, .base_mode = base_mode}, kController);
  }
  void reading(std::int64_t now_ns) {
    if (is_silent || imu_hz == 0) return;
    HighresImu message;
    message.time_usec = static_cast<std::uint64_t>((now_ns - booted_ns) / 1000);
    message.zacc = -9.81F;
    message.fields_updated = 63;
    peer_.send(message, kController);
  }
  void receive(const Packet& packet, std::int64_t now_ns) {
    if (is_silent) return;
    Timesync sync;
    ParamRequestRead request;
    CommandLong command;
    if (unpack(packet, sync) && sync.tc1 == 0) peer_.send(Timesync{now_ns - booted_ns, sync.ts1, 0, 0}, kController);
    if (unpack(packet, request)) answer(request);
    if (unpack(packet, command)) answer(command, packet.from);
  }

 private:
  void answer(const ParamRequestRead& request) {
    const bool is_mine = request.target_system == 1 && (request.target_component == 1 || request.target_component == 0);
    if (!is_mine || request.param_index != -1) return;
    const auto* const end = std::find(request.param_id.begin(), request.param_id.end(), '\0');
    const auto found = parameters.find(std::string(request.param_id.begin(), end));
    if (found == parameters.end()) return;
    ParamValue value;
    value.param_id = request.param_id;
    value.param_count = 900;
    value.param_index = 65'535;
    value.param_value = static_cast<float>(found->second);
    constexpr std::uint8_t kInt8 = 2, kInt32 = 6, kReal = 9;
    const bool is_integer = !is_float.contains(found->first);
    value.param_type = is_integer ? (autopilot_ == kIsPx4 ? kInt32 : kInt8) : kReal;
    if (is_integer && autopilot_ == kIsPx4) {
      const auto bits = static_cast<std::int32_t>(found->second);
      std::memcpy(&value.param_value, &bits, sizeof bits);
    }
    peer_.send(value, kController);
  }
  void answer(const CommandLong& command, Address from) {
    constexpr std::uint16_t kInterval = 511, kRequest = 512;
    if (command.target_system != 1 || command.target_component != 1) return;
    CommandAck ack{.command = command.command, .target_system = from.system, .target_component = from.component};
    const auto message = static_cast<std::uint32_t>(command.param1);
    if (command.command == kInterval && message == HighresImu::kId) imu_hz = 1e6 / static_cast<double>(command.param2);
    if (command.command == kRequest) ack.result = says(message) ? 0 : 2;
    peer_.send(ack, kController);
  }
  bool says(std::uint32_t message) {
    if (message == AutopilotVersion::kId) {
      AutopilotVersion version;
      version.flight_sw_version = version_[0] << 24U | version_[1] << 16U | version_[2] << 8U | 255U;
      peer_.send(version, kController);
      return true;
    }
    if (message != GpsGlobalOrigin::kId || !has_origin) return false;
    peer_.send(GpsGlobalOrigin{.latitude = 1, .longitude = 2}, kController);
    return true;
  }

  Peer& peer_;
  std::uint8_t autopilot_;
  std::array<unsigned, 3> version_;
};

}  // namespace epiline::mavlink
