#pragma once
// Sensors of tests that go in real time: a camera and an IMU that stand still.
#include <algorithm>
#include <array>
#include <chrono>
#include <random>
#include <thread>
#include <vector>

#include "platform/ports/ports.h"
#include "platform/time/monotonic.h"

namespace epiline::test {

/// A camera that stands before a wall of random texture, with noise.
class StandingCamera : public CameraSource {
 public:
  static constexpr int kWidth = 320, kHeight = 240, kSlots = 8;
  Status open() override {
    std::mt19937 random(1);
    wall_.resize(kWidth * kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        // blocks of 6 x 6 pixels
        std::minstd_rand block(static_cast<unsigned>(1 + (y / 6) * 1000 + x / 6));
        block.discard(3);
        wall_[static_cast<std::size_t>(y * kWidth + x)] = static_cast<std::uint8_t>(40 + block() % 160);
      }
    }
    next_ns_ = monotonic_ns();
    ++opened;
    return Done{};
  }
  void close() noexcept override { ++closed; }
  ReadOutcome read(Frame& frame, Span timeout) noexcept override {
    const std::int64_t wait_ns = std::min(next_ns_ - monotonic_ns(), timeout.ns);
    if (wait_ns > 0) std::this_thread::sleep_for(std::chrono::nanoseconds(wait_ns));
    if (monotonic_ns() < next_ns_) return ReadOutcome::kTimeout;
    std::vector<std::uint8_t>& image = images_[sequence_ % kSlots];
    image = wall_;
    for (std::size_t i = 0; i < image.size(); i += 3) image[i] = static_cast<std::uint8_t>(image[i] + random_() % 5);
    frame = {};
    frame.stamp = frame.arrival = HostStamp{next_ns_};
    frame.slot = static_cast<int>(sequence_ % kSlots);
    frame.sequence = sequence_++;
    frame.data = image.data();
    frame.width = frame.stride = kWidth;
    frame.height = kHeight;
    next_ns_ += 50'000'000;
    return ReadOutcome::kSample;
  }
  void give_back(const Frame& /*frame*/) noexcept override {}
  int opened = 0, closed = 0;

 private:
  std::vector<std::uint8_t> wall_;
  std::array<std::vector<std::uint8_t>, kSlots> images_;
  std::minstd_rand random_;
  std::uint64_t sequence_ = 0;
  std::int64_t next_ns_ = 0;
};

/// An IMU that stands too, with noise.
class StandingImu : public ImuSource {
 public:
  Status open() override {
    next_ns_ = monotonic_ns();
    return Done{};
  }
  void close() noexcept override { ++closed; }
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span /*timeout*/) noexcept override {
    std::this_thread::sleep_for(std::chrono::nanoseconds(std::max<std::int64_t>(next_ns_ - monotonic_ns(), 0)));
    ImuSample& s = samples[0];
    s = {};
    s.stamp = s.arrival = HostStamp{next_ns_};
    for (double& w : s.angular_velocity_rad_s) w = 2e-3 * noise_(random_);
    s.specific_force_m_s2 = {2e-2 * noise_(random_), 2e-2 * noise_(random_), 9.81 + 2e-2 * noise_(random_)};
    next_ns_ += 5'000'000;
    count = 1;
    return ReadOutcome::kSample;
  }
  int closed = 0;

 private:
  std::minstd_rand random_;
  std::normal_distribution<double> noise_;
  std::int64_t next_ns_ = 0;
};

}  // namespace epiline::test
