#pragma once
// The receiving side of a flight controller: answers as one, and judges what it is told by the rules of PX4 and
// ArduPilot. It opens nothing and reads no clock: packets go in with their times of arrival. One thread. Page:
// docs/hil.md.
#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

#include "drivers/links/mavlink/packet.h"
#include "drivers/program/hil/can_reader.h"
#include "drivers/program/hil/fusion_model.h"
#include "drivers/program/hil/motion_rules.h"
#include "drivers/program/hil/rules.h"
#include "drivers/program/hil/stream_rules.h"
#include "drivers/program/hil/timesync_filter.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/samples/samples.h"
#include "platform/time/latency_bins.h"

namespace epiline::hil {

struct ControllerSettings {
  std::uint8_t system = 1;                          ///< of the vehicle, companion included
  std::uint8_t companion = 197;                     ///< component that odometry has to come from
  Span boot = Span::from_milliseconds(-3'600'000);  ///< instant of the host's clock at which the controller's was 0
  double skew_ppm = 0;                              ///< its clock runs so much faster than the host's
  bool on_can = false;                              ///< hears CAN frames, and has the host's clock
  int can_base_id = 0x300;
  double timesync_hz = 10;       ///< questions of its own
  bool is_ardupilot = false;     ///< by its heartbeat
  bool wants_origin = false;     ///< has no satellite receiver, as an ArduPilot
  Mat3 R_VB = Mat3::Identity();  ///< the recording's IMU in the vehicle (forward, left, up)
};

class ControllerModel {
 public:
  /// The true state at a stamp of the odometry; none where it is not known.
  using Truth = std::function<std::optional<TruthState>(HostStamp)>;

  explicit ControllerModel(const ControllerSettings& settings, Truth truth = {});

  void receive(const mavlink::Packet& packet, HostStamp arrival);
  /// Of a bus.
  void receive(const can::Frame& frame, HostStamp arrival);
  /// The next packet to send, valid until the next call; null: none is due. Call until null, again every few ms.
  const mavlink::Packet* next(HostStamp now);

  /// A reading of the controller's own IMU, stamped by the host's clock; goes out as HIGHRES_IMU, as often as the
  /// companion asked (SET_MESSAGE_INTERVAL; before, 50 Hz). One other thread may call this. False: there is no room.
  bool feed(const ImuSample& reading) { return readings_.push(reading); }
  /// Called when the companion asks for these readings, from the thread that calls receive(). Before the first packet.
  void when_readings_are_wanted(std::function<void()> call) { readings_wanted_ = std::move(call); }

  /// Judges what can be judged at the end only. `end`: when the flight was over.
  Verdict finish(HostStamp end);

  /// Arrival less time_usec, while the clocks are known.
  const LatencyBins& latency() const { return latency_; }
  std::uint64_t estimates() const { return estimates_; }
  /// What can be used of them: the recording's IMU, stamped as the companion says. A new part for each reset counter,
  /// because a reset may turn and move the frame.
  const std::vector<Trajectory>& received() const { return received_; }
  std::int64_t to_controller_ns(HostStamp host) const;

 private:
  void receive(const mavlink::Odometry& message, HostStamp arrival);
  void receive(const mavlink::VisionPositionEstimate& message, HostStamp arrival);
  void receive(const mavlink::Heartbeat& message, HostStamp arrival);
  void receive(const mavlink::Timesync& message, HostStamp arrival);
  void receive(const mavlink::StatusText& message, HostStamp arrival);
  void receive(const mavlink::CommandLong& message, HostStamp arrival);
  void receive(const mavlink::SetGpsGlobalOrigin& message, HostStamp arrival);
  void send_reading(const ImuSample& reading);
  void judge_sender(const mavlink::Packet& packet, HostStamp arrival);
  void take_estimate(const std::optional<VisionSample>& sample, HostStamp arrival);
  void judge_latency(const VisionSample& sample);
  void judge_heartbeats(HostStamp until);
  void take_answer(const mavlink::Timesync& message, HostStamp arrival);
  void ask(HostStamp now);
  void judge_answer(bool good, HostStamp at, const char* what);
  template <class Message>
  void send(const Message& message);

  ControllerSettings settings_;
  Truth truth_;
  RuleBook book_;
  CanReader can_;
  StreamRules stream_;
  MotionRules motion_;
  FusionModel fusion_;
  TimesyncFilter timesync_;
  LatencyBins latency_;
  std::vector<Trajectory> received_;
  std::optional<std::uint8_t> newest_counter_;  ///< of its last part

  std::optional<HostStamp> begin_, newest_heartbeat_, first_packet_, first_heartbeat_;
  std::uint64_t heartbeats_ = 0, estimates_ = 0, texts_in_window_ = 0, exchanges_ = 0;
  std::optional<HostStamp> text_window_;
  std::optional<mavlink::SetGpsGlobalOrigin> origin_;  ///< the first
  std::optional<std::uint8_t> newest_sequence_;
  std::optional<HostStamp> next_heartbeat_, next_question_;
  std::optional<std::int64_t> question_ns_;  ///< not answered yet, of the controller's clock
  int failed_in_a_row_ = 0;
  LatencyBins round_trip_;

  static constexpr std::size_t kMostWaiting = 64;  ///< answers; who asks more gets none
  std::deque<mavlink::Packet> waiting_;
  mavlink::Packet sending_;
  SpscRing<ImuSample, 1024> readings_;
  Span reading_every_ = Span::from_milliseconds(20);
  std::optional<HostStamp> next_reading_;
  std::function<void()> readings_wanted_ = [] {};
  std::uint8_t sequence_ = 0;
};

}  // namespace epiline::hil
