#pragma once
// From the real-time threads to the log thread, and from there to the observers. A full ring refuses and counts: no
// real-time thread ever waits for the log.
#include <array>
#include <atomic>
#include <cstdint>
#include <utility>
#include <vector>

#include "pipeline/realtime/flight_observer.h"
#include "platform/log/event_merge.h"

namespace epiline {

/// Odometry that was handed out.
struct Publication {
  std::uint64_t serial = 0;  ///< of the FrameOutcome
  std::int64_t latency_ns = 0;
};

class FlightLog {
 public:
  /// The threads that have a ring for their events.
  enum class Speaker : std::uint8_t { kImu, kCapture, kTrack, kEstimate, kPublish, kWheel, kCount };
  static constexpr Span kEventWindow = Span::from_milliseconds(500);  ///< how late an event may come and find its place

  /// `more`: events of other threads, for instance of watchdogs. `images`: buffers of the camera that the log may hold
  /// at a time. All outlive the log.
  FlightLog(std::vector<FlightObserver*> observers, std::vector<EventRing*> more, int images);

  // Each for one real-time thread; wait-free.

  /// Thread imu.
  void imu(const ImuSample& sample) noexcept { imu_.push(sample); }
  /// Thread wheel.
  void wheel(const WheelSample& sample) noexcept { wheel_.push(sample); }
  /// Thread track: true if the log takes the image; the log thread gives it back.
  bool wants_image() const noexcept { return images_at_once_ > 0; }
  bool image(const Frame& frame) noexcept;
  /// Thread estimate: what came of an image. False: no room.
  bool image_done(std::uint64_t serial, const TrackedFrame& tracked, const StepResult& result, const StageTime& track,
                  const BackEnd& stage) noexcept;
  /// Thread publish.
  void published(std::uint64_t serial, std::int64_t latency_ns) noexcept { publications_.push({serial, latency_ns}); }
  /// Where the speaker's own thread puts its events.
  EventRing& events_of(Speaker speaker) noexcept { return events_[static_cast<std::size_t>(speaker)]; }

  // Log thread.

  bool empty() noexcept { return outcomes_.front() == nullptr && publications_.front() == nullptr; }
  /// Elements that a ring elsewhere has refused so far; what is new becomes an event.
  void note_lost(RingName ring, std::uint64_t dropped, HostStamp now) noexcept;
  /// Hands everything that has come to the observers. Events after `settled` are kept back: earlier ones may still
  /// come. `give_back` is called with each image.
  template <class GiveBack>
  void drain(HostStamp now, HostStamp settled, GiveBack&& give_back) noexcept {
    drain_samples();
    for (const Frame* frame = images_.front(); frame != nullptr; frame = images_.front()) {
      for (FlightObserver* o : observers_) {
        if (o->wants_images()) o->image(*frame);
      }
      give_back(*frame);
      images_.pop();
    }
    drain_events(now, settled);
    for (FlightObserver* o : observers_) o->pass(now);
  }

  // Any thread.

  /// Calls `f(RingName, ring)` for each of the log's own rings.
  template <class F>
  void each_ring(F&& f) const {
    f(RingName::kOutcomes, outcomes_);
    f(RingName::kPublications, publications_);
    f(RingName::kTracksToLog, tracks_);
    f(RingName::kImuToLog, imu_);
    f(RingName::kImagesToLog, images_);
    f(RingName::kWheelToLog, wheel_);
  }
  /// Images that the log left out because it still held as many as it may.
  std::uint64_t images_skipped() const noexcept { return images_skipped_.load(std::memory_order_relaxed); }
  /// Events that found no room in their ring.
  std::uint64_t events_dropped() const noexcept;

 private:
  static constexpr std::size_t kSpeakers = static_cast<std::size_t>(Speaker::kCount);
  static constexpr std::size_t kMostImages = 8;

  void drain_samples() noexcept;
  void drain_events(HostStamp now, HostStamp settled) noexcept;
  void gather(const Event& event) noexcept;
  void tell(const Event& event) noexcept;

  std::vector<FlightObserver*> observers_;
  std::vector<EventRing*> more_;
  std::uint64_t images_at_once_;

  SpscRing<ImuSample, 4096> imu_;     // 4 s at 1 kHz: a log thread that gets no processor for so long loses readings
  SpscRing<WheelSample, 512> wheel_;  // as long at 100 Hz
  SpscRing<FrameOutcome, 256> outcomes_;
  SpscRing<LoggedTracks, 64> tracks_;
  SpscRing<Publication, 256> publications_;
  SpscRing<Frame, kMostImages> images_;
  std::atomic<std::uint64_t> images_skipped_{0};  // one writer: track
  std::array<EventRing, kSpeakers> events_;

  // The log thread's own.
  EventMerge<4096> merge_;
  std::array<std::uint64_t, static_cast<std::size_t>(RingName::kCount)> lost_{};
};

}  // namespace epiline
