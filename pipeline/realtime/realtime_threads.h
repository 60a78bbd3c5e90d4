#pragma once
// The inside of RealtimePipeline: its threads and what lies between them. Their loops are in source_threads.cc (imu,
// capture, wheel), stage_threads.cc (track, estimate) and output_threads.cc (publish, log).
#include <array>
#include <atomic>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>

#include "pipeline/realtime/flight_log.h"
#include "pipeline/realtime/realtime_pipeline.h"
#include "pipeline/stages/estimator_events.h"
#include "pipeline/stages/front_end.h"
#include "pipeline/stages/imu_feed.h"
#include "pipeline/stages/knowledge.h"
#include "pipeline/watch/health_merge.h"
#include "pipeline/watch/image_gate.h"
#include "pipeline/watch/imu_gate.h"
#include "pipeline/watch/input_events.h"
#include "platform/concurrency/counter.h"
#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/loans.h"
#include "platform/concurrency/newest_ring.h"
#include "platform/concurrency/parking.h"

namespace epiline {

inline constexpr StageClocks kThreadClocks{monotonic_ns, thread_cpu_ns};
inline constexpr Span kPoll = Span::from_milliseconds(100);  // how soon an idle thread looks around
inline constexpr std::size_t kImuRing = 4096;                // 20 s at 200 Hz, 4 s at 1 kHz
using ImuRing = SpscRing<ImuSample, kImuRing>;

/// An image on its way from the tracker to the estimator.
struct Tracked {
  TrackedFrame frame;
  std::int64_t deadline_ns = 0;
  StageTime track;
};

/// The newest estimate, for the publisher.
struct Estimate {
  std::uint64_t serial = 0;  ///< from 1; 0: none yet
  bool has_pose = false;
  Odometry odometry;
  // What the prediction is corrected with, once for each `solved_serial`. It is repeated in later estimates: one that
  // was superseded is not lost.
  std::uint64_t solved_serial = 0;  ///< 0: none yet
  Odometry solved;
};

/// When a sensor last gave something, told to the publisher. Each number stands for itself: no order is needed.
struct Heard {
  std::atomic<std::int64_t> last_ns{0}, period_ns{0};
  void tell(HostStamp last, Span period) {
    last_ns.store(last.ns, std::memory_order_relaxed);
    period_ns.store(period.ns, std::memory_order_relaxed);
  }
};

struct RealtimePipeline::Impl {
  /// A thread, where it parks, and what it cost.
  struct Worker {
    const char* name = "";
    int priority = 0, cpu = -1;
    std::size_t stack_bytes = 0;
    void (Impl::*loop)() = nullptr;
    Impl* owner = nullptr;
    Parking parking;
    std::atomic<bool> ended{false};
    ThreadCosts costs;
    RealtimeThread thread;
  };

  Impl(const RealtimeSettings& settings, const RealtimePorts& ports);

  void start(Worker& worker);
  static void run(void* worker);
  template <class F>
  void each(F&& f) {
    for (Worker* w : {&imu, &capture, &track, &estimate, &publish, &log}) f(*w);
    if (ports.wheel != nullptr) f(wheel);
  }

  void imu_loop();
  void capture_loop();
  void wheel_loop();
  void track_loop();
  void estimate_loop();
  void publish_loop();
  void log_loop();

  void track_frame(const Frame& frame);
  void learn();
  void estimate_frame(const Tracked& tracked);
  void publish_estimate(const Estimate& newest);
  void correct_prediction(const Estimate& newest);
  void publish_prediction(const ImuSample& reading);
  void publish_silence();
  Odometry prediction_now();
  Health health_now(const Health& health) const;
  void log_round(bool last);
  std::int64_t deadline_of(HostStamp image) const;
  void give(FrontEnd& stage, const ImuSample& sample) { stage.add_imu(sample); }
  void give(BackEnd& stage, const ImuSample& sample);
  void take_wheel();
  void imu_is_late(Worker& worker, HostStamp needed);
  void log_image(const Frame& frame);
  template <class Stage>
  void take_imu(Worker& worker, ImuRing& ring, ImuFeed& feed, HostStamp needed, Stage& stage);
  template <class Stage>
  void relieve(ImuRing& ring, ImuFeed& feed, Stage& stage);
  /// One user of the image less; the last one gives it back to the camera.
  void give_back(std::size_t slot) {
    if (loans.give_back(slot)) ports.camera->give_back(slots[slot]);
  }
  void give_back_rest();
  void overtaken(NewestRing<4>::Value slot, FlightLog::Speaker speaker);
  void tell(FlightLog::Speaker speaker, HostStamp stamp, EventId id, std::int64_t a = 0, std::int64_t b = 0,
            std::int64_t c = 0) {
    flight_log.events_of(speaker).push({stamp, id, {a, b, c}});
  }
  /// Tells when a device is lost and when it is back.
  void note_source(ReadOutcome outcome, bool& lost, EventSource source, FlightLog::Speaker speaker);

  bool stopping() const { return stopped.load(std::memory_order_acquire); }
  bool has_ended(const Worker& worker) const { return worker.ended.load(std::memory_order_acquire); }
  void end(Worker& worker, std::initializer_list<Worker*> readers);
  /// A lost device may say so at once: no real-time thread may ask it all the time.
  void rest_after_failure(Worker& worker) {
    wait(worker, Span::from_milliseconds(10), [] { return false; });
  }
  template <class Ready>
  bool wait(Worker& worker, Span at_most, Ready ready) {
    return worker.parking.wait_until(monotonic_ns() + at_most.ns, [&] { return ready() || stopping(); });
  }

  RealtimeSettings settings;
  RealtimePorts ports;
  Pace pace;
  std::string memory_not_locked;
  std::atomic<bool> armed{false}, stopped{false};

  // The stages; each belongs to its thread.
  std::optional<FrontEnd> front_end;
  RecordedTracks recorded;
  BackEnd back_end;
  ImuFeed track_feed, estimate_feed;

  // What lies between the threads.
  std::array<Frame, kMostSlots> slots{};  ///< written by capture, read by whoever holds the slot
  Loans<kMostSlots> loans;                ///< who holds the slot: tracker, log
  NewestRing<4> frames;
  ImuRing imu_to_track, imu_to_estimate, imu_to_publish;
  SpscRing<WheelSample, 256> wheel_to_estimate;
  SpscRing<Tracked, 4> tracked;
  SpscRing<Knowledge, 4> knowledge;
  LatestValue<Estimate> newest;
  Heard heard_imu, heard_camera;
  FlightLog flight_log;

  // Of the threads imu and capture.
  ImuGate imu_gate;
  ImageGate image_gate;
  ImuEvents imu_events{flight_log.events_of(FlightLog::Speaker::kImu)};
  ImageEvents image_events{flight_log.events_of(FlightLog::Speaker::kCapture)};
  LastHeard imu_times, camera_times;  ///< each thread its own
  // The tracker's own.
  Knowledge known;
  std::uint64_t frames_tracked = 0, lessons = 0;  ///< lessons: taken from `knowledge`
  int previous_slot = -1;
  // The estimator's own.
  std::uint64_t solved_serial = 0;
  Odometry solved;
  EstimatorEvents estimator_events{flight_log.events_of(FlightLog::Speaker::kEstimate)};
  // The publisher's own.
  std::uint64_t last_published = 0, last_corrected = 0;
  std::uint32_t resets_seen = 0;
  Predictor predictor{predictor_config(settings.estimator)};
  LatencyBins prediction_latency;

  // Each written by one thread.
  std::atomic<std::uint64_t> frames_in{0}, frames_refused{0}, frames_out{0}, imu_in{0}, wheel_in{0}, track_imu_late{0},
      estimate_imu_late{0}, published{0}, publish_failed{0}, late{0}, predicted{0}, predict_failed{0};

  Worker imu, capture, track, estimate, publish, log, wheel;
};

}  // namespace epiline
