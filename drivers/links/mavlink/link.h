#pragma once
// The line to a flight controller. Page: docs/flight-controller.md.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "drivers/links/mavlink/controller_height.h"
#include "drivers/links/mavlink/controller_imu.h"
#include "drivers/links/mavlink/controller_survey.h"
#include "drivers/links/mavlink/imu_request.h"
#include "drivers/links/mavlink/message.h"
#include "drivers/links/mavlink/odometry.h"
#include "drivers/links/mavlink/packet.h"
#include "drivers/links/mavlink/pilot_news.h"
#include "drivers/links/mavlink/port.h"
#include "drivers/links/mavlink/signing.h"
#include "drivers/links/mavlink/timesync.h"
#include "drivers/links/stream/odometry_gate.h"
#include "drivers/links/stream/odometry_stream.h"
#include "drivers/links/stream/token_bucket.h"
#include "estimator/geometry/types.h"
#include "pipeline/config/devices.h"
#include "platform/concurrency/parking.h"
#include "platform/concurrency/snapshot.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/linux/realtime.h"
#include "platform/linux/system_calls.h"
#include "platform/ports/counter.h"
#include "platform/ports/ports.h"
#include "platform/time/backoff.h"
#include "platform/time/clock_state.h"
#include "platform/time/latency_bins.h"

namespace epiline::mavlink {

struct LinkCounts {
  // sent
  std::uint64_t odometry = 0;
  std::uint64_t dropped = 0;  ///< odometry that was due while the line was busy or gone
  std::uint64_t heartbeats = 0, texts = 0, timesync_questions = 0, timesync_answers = 0, requests = 0, origins = 0;
  std::uint64_t questions = 0;      ///< for release, parameters and the filter's status
  std::uint64_t origin_pauses = 0;  ///< of the odometry, while a controller got its origin
  // received
  std::uint64_t pieces = 0;  ///< datagrams, or reads of a serial line
  std::uint64_t packets = 0, bad_checksums = 0;
  std::uint64_t skipped_bytes = 0;      ///< noise, and unknown messages
  std::uint64_t unsigned_packets = 0;   ///< refused for want of a signature
  std::uint64_t wrong_signatures = 0;   ///< signed with another key
  std::uint64_t replayed_packets = 0;   ///< of an old signature
  std::uint64_t strangers = 0;          ///< packets that only the flight controller may send, from another sender
  std::uint64_t refused_questions = 0;  ///< TIMESYNC requests beyond any sensible rate
  std::uint64_t refused_answers = 0;    ///< TIMESYNC answers to no request of this link
  // the port
  std::uint64_t disconnected = 0;  ///< times the port was lost
  std::uint64_t retries = 0;       ///< failed attempts to reopen it
  std::uint64_t write_errors = 0;
  int last_error = 0;  ///< errno of the last of these
};
inline constexpr auto kLinkCounters = std::to_array<Counter<LinkCounts>>({
    {"packets", &LinkCounts::packets},
    {"bad_checksums", &LinkCounts::bad_checksums, true},
    {"skipped_bytes", &LinkCounts::skipped_bytes},
    {"unsigned_packets", &LinkCounts::unsigned_packets, true},
    {"wrong_signatures", &LinkCounts::wrong_signatures, true},
    {"replayed_packets", &LinkCounts::replayed_packets, true},
    {"strangers", &LinkCounts::strangers, true},
    {"refused_questions", &LinkCounts::refused_questions, true},
    {"refused_answers", &LinkCounts::refused_answers, true},
    {"timesync_answers", &LinkCounts::timesync_answers},
    {"questions", &LinkCounts::questions},
    {"origin_pauses", &LinkCounts::origin_pauses},
    {"disconnected", &LinkCounts::disconnected, true},
    {"retries", &LinkCounts::retries},
    {"write_errors", &LinkCounts::write_errors, true},
});

/// The flight controller: the first autopilot whose heartbeat carries the configured system id, and which is component
/// 1 and of a vehicle's type, if there is one.
struct LinkPeer {
  bool is_known = false;
  Address address;
  std::uint8_t autopilot = 0;  ///< MAV_AUTOPILOT: 3 ArduPilot, 12 PX4
  std::uint8_t type = 0;       ///< MAV_TYPE
  HostStamp last_heard;
};

/// Why the flight controller cannot use the odometry as configured, so that it is not sent.
enum class Refusal : std::uint8_t {
  kNone,
  kNeedsHeading,  ///< PX4 takes the message for one that has a north
  kTakesOnlyFrd,  ///< ArduPilot ignores other frames
};
/// What is wrong, and what to do, for the user; "" for kNone.
const char* sentence_of(Refusal refusal) noexcept;
const char* remedy_of(Refusal refusal) noexcept;

struct LinkState {
  bool is_open = false;  ///< false: the port is lost; the link tries to reopen it
  Condition condition = Condition::kWaiting;
  Refusal refusal = Refusal::kNone;
  LinkCounts counts;
  LinkPeer peer;
  ControllerImuCounts imu;
  RequestState imu_request = RequestState::kNone;
  ControllerHeightCounts heights;
  ControllerAnswers answers;
  HostStamp sending_since;  ///< odometry has been sent from then on; zero: it is not
  ClockState clock;         ///< of the flight controller, against ours
  ThreadCosts costs;        ///< of the link's thread since open()
};

/// The link to a flight controller. A thread of its own sends odometry, answers requests, and reopens a lost port;
/// publish() hands the odometry over and returns. After open() there is no heap call and no lock in either, also while
/// the port is lost.
class MavlinkLink final : public OdometrySink {
 public:
  /// `R_VB` rotates vectors from the IMU's axes to the vehicle's (forward, left, up). `priority`: SCHED_FIFO priority
  /// of the thread, where permitted.
  ///
  /// With `imu` the link also requests the flight controller's IMU samples, for MavlinkImu. They are in the vehicle's
  /// axes, so R_VB must be the identity.
  MavlinkLink(const MavlinkConfig& config, const Mat3& R_VB, const std::optional<ImuDeviceConfig>& imu = std::nullopt,
              int priority = 65, SystemCalls& system = SystemCalls::of_this_computer());
  ~MavlinkLink() override { close(); }

  /// Before open(): also requests the flight controller's heights of these kinds, for MavlinkHeight. `air_deg`: the
  /// air's temperature at the ground.
  void want_heights(const std::array<bool, kHeightKinds>& kinds, double air_deg);

  /// Opens the port and starts the thread. The error names the fault of the settings or the port.
  Status open() override;
  void close() noexcept override;
  bool publish(const epiline::Odometry& odometry) noexcept override;
  bool publish_image(const epiline::Odometry& odometry) noexcept override;

  /// For tests: open() without the thread. Then the caller does what the thread would do, turn() after turn().
  Status begin();
  /// Does what is to be done, then waits until there is more, at most a second.
  void turn() noexcept;

  /// As ImuSource::read(), for samples since the first call; one thread. kFailed: the port is lost.
  ReadOutcome read_imu(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept;

  /// The same for heights.
  ReadOutcome read_height(HeightSample& sample, Span timeout) noexcept;

  /// The port, as the configuration names it.
  const std::string& name() const noexcept { return config_.serial.empty() ? config_.udp : config_.serial; }
  /// From any thread. Latencies are at most one second old, other values current.
  LinkState state() const noexcept { return told_.read(); }
  LinkCounts counts() const noexcept { return state().counts; }
  ClockState clock_state() const noexcept { return state().clock; }
  /// Latency from an image's timestamp until the kernel has the last byte of the first odometry that contains the
  /// image.
  LatencyBins latency() const noexcept { return told_latency_.read(); }

 private:
  static constexpr std::size_t kReadings = 1024, kHeights = 64;
  static constexpr std::size_t kOdometryBehind = 64;  ///< bytes in the kernel that odometry may wait for
  static constexpr std::int64_t kSecond_ns = 1'000'000'000, kFar_ns = std::numeric_limits<std::int64_t>::max();

  Status check() const;
  Result<std::unique_ptr<Port>> make_port() const;
  // The thread's.
  static void run(void* self);
  void wait() noexcept;
  std::int64_t next_event_ns(std::int64_t now_ns) const noexcept;
  void keep_port(std::int64_t now_ns) noexcept;
  void lose(std::int64_t now_ns, int error) noexcept;
  void read_port(std::int64_t now_ns) noexcept;
  bool is_authentic() noexcept;
  void receive(const Packet& packet, std::int64_t now_ns) noexcept;
  template <class Message>
  void receive_reading(const Message& message, std::int64_t now_ns) noexcept;
  void receive_height(const Packet& packet, std::int64_t now_ns) noexcept;
  std::int64_t heights_due_ns() const noexcept;
  void receive_heartbeat(const Packet& packet, std::int64_t now_ns) noexcept;
  void begin_with_peer(std::int64_t now_ns) noexcept;
  void receive_origin(const GpsGlobalOrigin& origin, std::int64_t now_ns) noexcept;
  std::optional<ControllerSurvey::Question> survey_question(std::int64_t now_ns) noexcept;
  Refusal refusal() const noexcept;
  bool is_odometry_held() const noexcept;
  std::int64_t odometry_due_ns() const noexcept;
  void look_at_estimate(std::int64_t now_ns) noexcept;
  void write_port() noexcept;
  bool flush() noexcept;
  bool compose(std::int64_t now_ns) noexcept;
  template <class Message>
  void put(const Message& message, std::uint64_t& count) noexcept;
  void put_odometry(std::int64_t now_ns) noexcept;
  std::optional<CommandLong> height_question(std::int64_t now_ns) noexcept;
  bool is_frame_waiting() const noexcept { return frame_sent_ < frame_.size; }
  bool wants_origin() const noexcept;
  void tell(std::int64_t now_ns) noexcept;

  MavlinkConfig config_;
  Mat3 R_VB_;
  int priority_;
  SystemCalls& system_;
  std::unique_ptr<Port> port_;
  WakeUp wake_up_{system_};
  RealtimeThread thread_;
  std::atomic<bool> stop_{false}, is_open_{false};

  OdometryStream stream_;  ///< from the publishing thread

  // To the thread that reads the IMU.
  std::atomic<bool> has_reader_{false};
  SpscRing<ImuSample, kReadings> readings_;
  Parking readings_parking_;
  // The same for heights.
  std::atomic<bool> has_height_reader_{false};
  SpscRing<HeightSample, kHeights> heights_read_;
  Parking heights_parking_;

  // The thread's own.
  LocalFrame local_frame_;
  Address own_;
  Parser parser_;
  std::optional<Signing> signing_;
  std::int64_t question_period_ns_;
  TimesyncExchange timesync_;
  TokenBucket input_;
  std::optional<ControllerImu> imu_;
  std::optional<ImuRequest> imu_request_;
  std::optional<ControllerHeight> heights_;
  std::optional<HeightRequest> height_request_;
  ControllerSurvey survey_;
  PilotNews news_;
  LinkState state_;
  ThreadCosts costs_at_start_;
  FrameBytes frame_;            ///< on its way into the port
  std::size_t frame_sent_ = 0;  ///< of it
  bool is_frame_odometry_ = false;
  std::uint8_t sequence_ = 0;
  bool has_origin_ = false;                ///< the flight controller has one
  std::optional<GpsGlobalOrigin> origin_;  ///< the newest, also from before the line was lost
  bool is_paused_ = false;                 ///< no odometry until pause_until_ns_
  std::int64_t pause_until_ns_ = 0, last_odometry_ns_ = 0;
  std::int64_t doubtful_since_ns_ = 0;  ///< first heartbeat of a possible autopilot; 0: none yet
  std::int64_t next_heartbeat_ns_ = 0, next_question_ns_ = 0, next_origin_ns_ = 0, next_latency_ns_ = 0;
  std::int64_t opened_ns_ = 0;
  Backoff retry_{Span::from_milliseconds(50), Span::from_milliseconds(500)};
  std::size_t backlog_ = 0;  ///< bytes the kernel has and the line has not

  Snapshot<LinkState> told_;
  Snapshot<LatencyBins> told_latency_;
};

}  // namespace epiline::mavlink
