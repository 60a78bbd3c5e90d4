#pragma once
// An IMU at rest, for flights in threads.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <random>
#include <thread>

#include "platform/ports/ports.h"

namespace epiline::test {

inline constexpr int kReadingRate = 200;
inline constexpr HostStamp kFirstReading{50'000'000'000};

inline HostStamp reading_stamp(int i) { return kFirstReading + Span{1'000'000'000LL * i / kReadingRate}; }

inline void nap() { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

/// Readings of a body at rest, as fast as they are asked for, and none from `hold_at` on until that is moved.
class RestingImu final : public ImuSource {
 public:
  explicit RestingImu(int readings) : readings_(readings) {}
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span) noexcept override {
    count = 0;
    if (next_ == readings_) return ReadOutcome::kEnd;
    if (next_ == hold_at.load()) {
      nap();
      return ReadOutcome::kTimeout;
    }
    constexpr std::size_t kAtOnce = 8;
    while (count < std::min(samples.size(), kAtOnce) && next_ < std::min(readings_, hold_at.load())) {
      ImuSample& s = samples[count++];
      s = {};
      s.stamp = reading_stamp(next_++);
      for (double& w : s.angular_velocity_rad_s) w = noise_(random_) * 0.002;
      s.specific_force_m_s2 = {0.02 * noise_(random_), 0.02 * noise_(random_), 9.81 + 0.02 * noise_(random_)};
    }
    given = next_;
    return ReadOutcome::kSample;
  }

  static constexpr int kNever = 1 << 30;
  std::atomic<int> hold_at{kNever}, given{0};

 private:
  int readings_, next_ = 0;
  std::mt19937 random_{1};
  std::normal_distribution<double> noise_{0, 1};
};

}  // namespace epiline::test
