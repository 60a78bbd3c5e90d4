#pragma once
// Passes data from the log thread to the thread that serves the live view, through wait-free rings of fixed size. Data
// that finds a ring full is left out and counted, so a browser cannot block the log thread.
#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "pipeline/realtime/flight_observer.h"
#include "platform/concurrency/spsc_ring.h"

namespace epiline {

/// A copy of an image and its tracks. The images of other cameras are at the right of the first one's.
struct ViewedImage {
  static constexpr std::size_t kMostPixels = 1024 * 1024;  ///< larger images are thinned: every second, third, ...

  HostStamp stamp;
  std::uint64_t sequence = 0;
  int camera_width = 0, camera_height = 0;  ///< of all together; 0: no image came with the tracks
  std::array<int, kMostOthers> others_x{};  ///< where the image of camera 1, 2 or 3 begins; 0: there is none
  int width = 0, height = 0;                ///< of the copy; its rows follow each other
  bool has_tracks = false;
  /// In pixels of their camera, also of a thinned copy.
  FixedVector<LoggedPoint, kMaxFeatures> tracks;
  std::array<FixedVector<LoggedPoint, kMaxFeatures>, kMostOthers> other_tracks;
  std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(kMostPixels);
};

/// The outcome of an image, and the counters at that time.
struct ViewedOutcome {
  FrameOutcome outcome;
  std::uint64_t imu_samples = 0;  ///< since the beginning
  HostStamp newest_imu;
  std::uint64_t images_lost = 0;  ///< gaps in the camera's numbers
};

class ViewFeed final : public FlightObserver {
 public:
  ViewFeed();
  /// Call before the flight. False: only tracks will arrive, no images.
  void expect_images(bool expected) { images_expected_ = expected; }

  // Log thread only. Bounded: at most one copy of an image, about 20 times a second while a page is open, else once.

  void take(const FrameOutcome& outcome) noexcept override;
  void published(std::uint64_t serial, std::int64_t latency_ns) noexcept override;
  void imu(const ImuSample& sample) noexcept override;
  void tracks(const LoggedTracks& tracks) noexcept override;
  void image(const Frame& frame, const OtherFrames& others) noexcept override;
  void event(const Event& event) noexcept override;
  bool wants_images() const noexcept override { return images_expected_; }

  // Serving thread only.

  /// Notes that a client requested data at `now_ns`.
  void note_viewer(std::int64_t now_ns) noexcept { seen_ns_.store(now_ns, std::memory_order_relaxed); }
  bool next(ViewedOutcome& out) noexcept { return outcomes_.pop(out); }
  bool next(Publication& out) noexcept { return latencies_.pop(out); }
  bool next(Event& out) noexcept { return events_.pop(out); }
  /// The newest image since the last call, valid until the next call; null if none came.
  const ViewedImage* newest_image() noexcept;
  /// Number of elements dropped because a ring was full.
  std::uint64_t left_out() const noexcept { return outcomes_.dropped() + latencies_.dropped() + events_.dropped(); }

 private:
  static constexpr int kNone = -1;

  ViewedImage* draft_for(std::uint64_t sequence, HostStamp stamp) noexcept;
  bool draft_is_whole() const noexcept;
  void hand_over() noexcept;

  SpscRing<ViewedOutcome, 128> outcomes_;
  SpscRing<Publication, 256> latencies_;
  SpscRing<Event, 256> events_;
  // Three buffers circulate: one is being filled, one is shown, one is on its way.
  std::array<ViewedImage, 3> buffers_;
  SpscRing<int, 4> filled_, empty_;
  std::atomic<std::int64_t> seen_ns_;

  // Log thread only.
  int draft_ = kNone;
  std::array<int, kMostOthers> other_widths_{};  ///< of those cameras' images, once one came
  std::uint64_t draft_sequence_ = 0;
  bool images_expected_ = true, sequence_known_ = false;
  std::uint64_t newest_sequence_ = 0, images_lost_ = 0, imu_samples_ = 0;
  HostStamp newest_imu_;
  std::int64_t last_draft_ns_;
  // Serving thread only.
  int shown_ = kNone;
};

}  // namespace epiline
