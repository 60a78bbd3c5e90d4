#pragma once
// From the real-time threads to the log thread, and from there to the observers. A full ring refuses and counts: no
// real-time thread ever waits for the log.
#include <array>
#include <cstdint>
#include <vector>

#include "pipeline/realtime/flight_observer.h"
#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/lent_images.h"
#include "platform/log/event_merge.h"

namespace epiline {

class FlightLog {
 public:
  /// The threads that have a ring for their events.
  enum class Speaker : std::uint8_t { kImu, kCapture, kTrack, kEstimate, kWheel, kHeight, kCount };
  static constexpr Span kEventWindow = Span::from_milliseconds(500);  ///< how late an event may come and find its place

  /// `more`: events of other threads, for instance of watchdogs. `images`: buffers of the camera that the log may hold
  /// at a time. All outlive the log.
  FlightLog(std::vector<FlightObserver*> observers, std::vector<EventRing*> more, int images);

  // Each is filled by the thread of one stage.

  ImuLogRing& imu() noexcept { return imu_; }
  WheelLogRing& wheel() noexcept { return wheel_; }
  HeightLogRing& height() noexcept { return height_; }
  LoggedImages& images() noexcept { return images_; }
  OutcomeRing& outcomes() noexcept { return outcomes_; }
  TracksLogRing& tracks() noexcept { return tracks_; }
  PublicationRing& publications() noexcept { return publications_; }
  /// Where the speaker's own thread puts its events.
  EventRing& events_of(Speaker speaker) noexcept { return events_[static_cast<std::size_t>(speaker)]; }

  // Log thread.

  bool empty() noexcept { return outcomes_.front() == nullptr && publications_.front() == nullptr; }
  /// Elements that a ring elsewhere has refused so far; what is new becomes an event.
  void note_lost(RingName ring, std::uint64_t dropped, HostStamp now) noexcept;
  /// Hands everything that has come to the observers. Events after `settled` are kept back: earlier ones may still
  /// come. `lent`: the log's images are given back there.
  void drain(HostStamp now, HostStamp settled, LentImages& lent) noexcept;

  // Any thread.

  /// Calls `f(RingName, ring)` for each of the log's own rings.
  template <class F>
  void each_ring(F&& f) const {
    f(RingName::kOutcomes, outcomes_);
    f(RingName::kPublications, publications_);
    f(RingName::kTracksToLog, tracks_);
    f(RingName::kImuToLog, imu_);
    f(RingName::kImagesToLog, images_.ring());
    f(RingName::kWheelToLog, wheel_);
    f(RingName::kHeightToLog, height_);
  }
  /// Images that the log left out because it still held as many as it may.
  std::uint64_t images_skipped() const noexcept { return images_.skipped(); }
  /// Events that found no room in their ring.
  std::uint64_t events_dropped() const noexcept;

 private:
  static constexpr std::size_t kSpeakers = static_cast<std::size_t>(Speaker::kCount);

  void drain_samples() noexcept;
  void drain_images(LentImages& lent) noexcept;
  void drain_events(HostStamp now, HostStamp settled) noexcept;
  void gather(const Event& event) noexcept;
  void tell(const Event& event) noexcept;

  std::vector<FlightObserver*> observers_;
  std::vector<EventRing*> more_;

  ImuLogRing imu_;
  WheelLogRing wheel_;
  HeightLogRing height_;
  OutcomeRing outcomes_;
  TracksLogRing tracks_;
  PublicationRing publications_;
  LoggedImages images_;
  std::array<EventRing, kSpeakers> events_;

  // The log thread's own.
  EventMerge<4096> merge_;
  std::array<std::uint64_t, static_cast<std::size_t>(RingName::kCount)> lost_{};
};

}  // namespace epiline
