#pragma once
// A made-up flight for the live view: what an observer would be told of it.
#include <cmath>
#include <memory>
#include <vector>

#include "pipeline/realtime/flight_observer.h"

namespace epiline {

/// A flight in a circle with one camera image every 50 ms, all of one grey.
class ViewedFlight {
 public:
  static constexpr int kWidth = 320, kHeight = 200;
  static constexpr std::uint8_t kGrey = 77;

  explicit ViewedFlight(FlightObserver& observer) : observer_(observer) {
    outcome_.result = {true, true};
    outcome_.odometry.health = {HealthState::kTracking, 0, 88};
    for (int i = 0; i < 3; ++i) outcome_.odometry.covariance[17 * i] = 1e-4;
  }

  FrameOutcome& next_outcome() { return outcome_; }  ///< to be changed before fly()
  double latency_ms = 1.5;

  void fly(int images) {
    for (int i = 0; i < images; ++i) fly();
  }
  /// One image: readings, outcome, tracks, pixels, latency.
  void fly() {
    const HostStamp stamp{static_cast<std::int64_t>(1e9) + 50'000'000 * static_cast<std::int64_t>(serial_)};
    for (int i = 0; i < 10; ++i) observer_.imu({stamp - Span{5'000'000 * (9 - i)}, {}, {}});
    const double angle = 0.05 * static_cast<double>(serial_);
    outcome_.serial = serial_;
    outcome_.stamp = outcome_.odometry.stamp = stamp;
    outcome_.odometry.p_WB_m = {2 * std::cos(angle), 2 * std::sin(angle), 0.3 * angle};
    outcome_.odometry.v_WB_m_s = {-2 * std::sin(angle), 2 * std::cos(angle), 0.3};
    outcome_.tracks = 40;
    observer_.take(outcome_);
    tracks_->serial = serial_;
    tracks_->sequence = serial_;
    tracks_->stamp = stamp;
    tracks_->points.clear();
    for (std::uint32_t i = 0; i < 40; ++i) {
      tracks_->points.push_back(
          {i, 0, static_cast<float>(20 + 7 * i), 100.0F + 0.5F * static_cast<float>(serial_ % 50)});
    }
    observer_.tracks(*tracks_);
    Frame frame{stamp, serial_, pixels_.data(), kWidth, kHeight, kWidth, 0};
    observer_.image(frame, {});
    observer_.published(serial_, static_cast<std::int64_t>(1e6 * latency_ms));
    ++serial_;
  }

 private:
  FlightObserver& observer_;
  std::uint64_t serial_ = 0;
  FrameOutcome outcome_;
  std::unique_ptr<LoggedTracks> tracks_ = std::make_unique<LoggedTracks>();
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(kWidth * kHeight, kGrey);
};

}  // namespace epiline
