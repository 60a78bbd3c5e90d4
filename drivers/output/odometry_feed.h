#pragma once
// From the thread that hands odometry out to one that sends it: the newest one, as often as it is wanted.
#include <atomic>
#include <cstdint>

#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/parking.h"
#include "platform/samples/samples.h"
#include "platform/time/monotonic.h"

namespace epiline {

/// Odometry on its way to a bus.
struct Offer {
  std::uint64_t serial = 0;  ///< from 1; 0: none yet
  std::int64_t offered_ns = 0;
  HostStamp image;  ///< the newest image it rests on, as handed to publish_image(); zero: none
  Odometry odometry;
};

/// One thread offers, another takes. Offering is wait-free but for the waking of a sleeping reader.
class OdometryFeed {
 public:
  explicit OdometryFeed(double rate_hz) : period_(Span::from_seconds(1 / rate_hz)) {}

  // The offering thread.

  /// Lets through one odometry per period, by their stamps, and any whose state, reasons or reset counter are others
  /// than those of the one let through before.
  void offer(const Odometry& odometry) noexcept {
    const std::int64_t now_ns = monotonic_ns();
    last_offer_ns_.store(now_ns, std::memory_order_relaxed);
    const bool changed =
        odometry.health.state != state_ || odometry.health.reasons != reasons_ || odometry.reset_counter != resets_;
    if (!is_due(odometry.stamp) && !changed) return;
    state_ = odometry.health.state;
    reasons_ = odometry.health.reasons;
    resets_ = odometry.reset_counter;
    Offer& draft = box_.draft();
    draft.serial = ++serial_;
    draft.offered_ns = now_ns;
    draft.image = image_;
    draft.odometry = odometry;
    box_.publish();
    parking_.notify();
  }
  void offer_image(const Odometry& odometry) noexcept { image_ = odometry.stamp; }

  // The sending thread.

  /// The newest offer, or null before the first; valid until the next call.
  const Offer* newest() noexcept { return box_.read(); }
  /// Sleeps until there is an offer other than `serial`, until `deadline_ns`, or until woken.
  bool wait(std::uint64_t serial, std::int64_t deadline_ns, const std::atomic<bool>& stop) noexcept {
    return parking_.wait_until(deadline_ns, [&] {
      const Offer* const offer = box_.read();
      return stop.load(std::memory_order_acquire) || (offer != nullptr && offer->serial != serial);
    });
  }

  // Any thread.

  void wake() noexcept { parking_.notify(); }
  /// When offer() was last called, whether or not it let the odometry through; 0: never.
  std::int64_t last_offer_ns() const noexcept { return last_offer_ns_.load(std::memory_order_relaxed); }

 private:
  /// Stamps on a grid of periods. A grid left far behind, or ahead of the stamps, begins anew.
  bool is_due(HostStamp stamp) noexcept {
    const Span early = due_ - stamp;
    if (early.ns > kSlack.ns && early <= period_ + kSlack) return false;
    due_ = early < -period_ || early.ns > kSlack.ns ? stamp + period_ : due_ + period_;
    return true;
  }
  static constexpr Span kSlack{500'000};  // stamps of an IMU are not exactly on a grid

  Span period_;
  HostStamp due_, image_;
  std::uint64_t serial_ = 0;
  HealthState state_ = HealthState::kInitialising;
  std::uint32_t reasons_ = 0, resets_ = 0;
  LatestValue<Offer> box_;
  std::atomic<std::int64_t> last_offer_ns_{0};
  Parking parking_;
};

}  // namespace epiline
