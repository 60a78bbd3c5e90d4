#pragma once
// Models the receiving side of a flight controller: answers like one, and judges the odometry by the rules of PX4 and
// ArduPilot. It opens no device and reads no clock: the caller passes packets with their times of arrival. One thread.
// Page: docs/hil.md.
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
  std::uint8_t companion = 197;                     ///< component that must send the odometry
  Span boot = Span::from_milliseconds(-3'600'000);  ///< instant of the host's clock at which the controller's was 0
  double skew_ppm = 0;                              ///< by how much its clock runs faster than the host's
  bool on_can = false;                              ///< hears CAN frames, and has the host's clock
  int can_base_id = 0x300;
  double timesync_hz = 10;       ///< rate of its own TIMESYNC requests
  bool is_ardupilot = false;     ///< by its heartbeat
  bool wants_origin = false;     ///< has no satellite receiver, so it needs the origin, as ArduPilot does
  Mat3 R_VB = Mat3::Identity();  ///< the recording's IMU in the vehicle (forward, left, up)
};

class ControllerModel {
 public:
  /// Ground truth at a timestamp of the odometry; none where it is not known.
  using Truth = std::function<std::optional<TruthState>(HostStamp)>;

  explicit ControllerModel(const ControllerSettings& settings, Truth truth = {});

  bool is_on_can() const { return settings_.on_can; }
  void receive(const mavlink::Packet& packet, HostStamp arrival);
  /// The same for a frame from a CAN bus.
  void receive(const can::Frame& frame, HostStamp arrival);
  /// The next packet to send, valid until the next call; null: none is due. Call every few ms, each time until null.
  const mavlink::Packet* next(HostStamp now);

  /// Takes a sample of the controller's own IMU, stamped by the host's clock. It is sent as HIGHRES_IMU, at the rate
  /// that the companion requested by SET_MESSAGE_INTERVAL, initially 50 Hz. One other thread may call this. False:
  /// queue full.
  bool feed(const ImuSample& reading) { return readings_.push(reading); }
  /// Sets the function that the thread of receive() calls when the companion requests these samples. Call before the
  /// first packet.
  void when_readings_are_wanted(std::function<void()> call) { readings_wanted_ = std::move(call); }

  /// Judges the rules that need the whole flight. `end`: end of the flight.
  Verdict finish(HostStamp end);

  /// Arrival minus time_usec, counted once the clock offset is known.
  const LatencyBins& latency() const { return latency_; }
  std::uint64_t estimates() const { return estimates_; }
  /// The usable estimates as poses of the recording's IMU, with the companion's timestamps. Each reset counter begins a
  /// new part, because a reset may rotate and shift the frame.
  const std::vector<Trajectory>& received() const { return received_; }
  std::int64_t to_controller_ns(HostStamp host) const;

 private:
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
  std::optional<std::uint8_t> newest_counter_;  ///< of the last part of received_

  std::optional<HostStamp> newest_heartbeat_, first_packet_, first_heartbeat_;
  std::uint64_t heartbeats_ = 0, estimates_ = 0, texts_in_window_ = 0, exchanges_ = 0;
  std::optional<HostStamp> text_window_;
  std::optional<mavlink::SetGpsGlobalOrigin> origin_;  ///< the first
  std::optional<std::uint8_t> newest_sequence_;
  std::optional<HostStamp> next_heartbeat_, next_question_;
  std::optional<std::int64_t> question_ns_;  ///< pending request, on the controller's clock
  int failed_in_a_row_ = 0;
  LatencyBins round_trip_;

  static constexpr std::size_t kMostWaiting = 64;  ///< answers; further requests get none
  std::deque<mavlink::Packet> waiting_;
  mavlink::Packet sending_;
  SpscRing<ImuSample, 1024> readings_;
  Span reading_every_ = Span::from_milliseconds(20);
  std::optional<HostStamp> next_reading_;
  std::function<void()> readings_wanted_ = [] {};
  std::uint8_t sequence_ = 0;
};

}  // namespace epiline::hil
