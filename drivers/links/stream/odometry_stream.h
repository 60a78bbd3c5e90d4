#pragma once
// Passes odometry from the publishing thread to a sending thread, and decides what is sent and when.
#include <cstdint>

#include "drivers/links/stream/odometry_gate.h"
#include "drivers/links/stream/send_schedule.h"
#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/samples/samples.h"
#include "platform/time/latency_bins.h"

namespace epiline {

/// Odometry on its way to a receiver.
struct Offer {
  Odometry odometry;
  std::uint64_t images = 0;     ///< number of images that it contains
  std::int64_t offered_ns = 0;  ///< monotonic_ns()
};

/// An image whose way is measured.
struct ImageMark {
  std::uint64_t number = 0;
  HostStamp stamp;
};

/// One thread offers odometry, another sends it. Does not wait or allocate, and does not wake the sender: the offering
/// thread does that after an offer. Times are monotonic_ns().
class OdometryStream {
 public:
  static constexpr std::int64_t kTooOld_ns = 100'000'000;  ///< odometry that waited longer is not sent
  static constexpr std::int64_t kSilence_ns =
      500'000'000;  ///< without an offer for this time, the estimator has stopped

  /// The reset counter begins with another number than in the previous run, because a restarted program has jumped.
  explicit OdometryStream(double rate_hz) noexcept;

  // The offering thread.

  void offer(const Odometry& odometry, std::int64_t now_ns) noexcept;
  /// The next offer contains this image.
  void offer_image(const Odometry& odometry) noexcept;

  // The sending thread.

  /// There is an offer that look() has not seen.
  bool has_news() noexcept;
  /// Looks at the newest offer. `is_open`: what is due could go; if not, the images that wait are not measured.
  void look(std::int64_t now_ns, bool is_open) noexcept;
  Condition condition() const noexcept { return condition_; }
  /// Of the newest offer; before the first: initialising, of no quality.
  const Health& health() const noexcept { return health_; }
  /// HealthReason bits; 0 without an estimate.
  std::uint32_t reasons() const noexcept;
  /// When look() would find that nothing is offered any more; far away if it has, or nothing was.
  std::int64_t silent_ns() const noexcept;

  /// When the odometry that waits is due; far away if none does.
  std::int64_t due_ns() const noexcept;
  /// There has been odometry that may be sent: next() is the newest.
  bool has_admitted() const noexcept { return next_.offered_ns != 0; }
  /// What is to be sent next, if something is due, with its reset counter.
  const Offer& next() const noexcept { return next_; }
  std::uint8_t reset_counter() const noexcept { return gate_.reset_counter(); }
  /// next() is on its way.
  void begun(std::int64_t now_ns) noexcept;
  /// Its last byte is with the kernel.
  void finished(std::int64_t now_ns) noexcept;

  /// One for each period in which odometry was due and could not go. To be called after each look().
  void count_dropped(std::int64_t now_ns, bool is_held_up) noexcept;
  std::uint64_t dropped() const noexcept { return dropped_; }
  /// Latency from an image's timestamp until the first odometry that contains it was sent.
  const LatencyBins& latency() const noexcept { return latency_; }

 private:
  static constexpr std::size_t kImages = 64;

  bool may_send() const noexcept;
  /// visit(mark) for each image up to `number` whose way was not over yet. Now it is.
  template <class Visit>
  void take_images(std::uint64_t number, Visit visit) noexcept;

  // From the offering thread.
  LatestValue<Offer> newest_;
  SpscRing<ImageMark, kImages> image_marks_;
  std::uint64_t images_ = 0;

  // The sending thread's.
  SendSchedule schedule_;
  OdometryGate gate_;
  LatencyBins latency_;
  Condition condition_ = Condition::kWaiting;
  Health health_{HealthState::kInitialising, 0, -1};
  Offer next_;  ///< the newest that may be sent
  bool has_unsent_ = false;
  std::int64_t seen_ns_ = 0;  ///< when the newest that was looked at was offered; 0: none
  std::uint64_t images_seen_ = 0, images_begun_ = 0;
  std::int64_t held_up_since_ns_ = 0;  ///< odometry was due and could not go: not counted as dropped yet. 0: none
  std::uint64_t dropped_ = 0;
};

}  // namespace epiline
