#pragma once
// Reads from a driver on a model, and compares with what the model knows.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/sensors/imu/spi_imu.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/sensors/imu/spi_world.h"

namespace epiline::test {

struct Comparison {
  std::size_t samples = 0, unknown = 0;  ///< `unknown`: with values no sample of the model had, or out of order
  std::size_t missing = 0;               ///< samples of the model between the first and the last that did not come
  std::int64_t worst_early_ns = 0, worst_late_ns = 0;  ///< stamp plus delay, against the time it was taken
  double worst_accel_m_s2 = 0;
  std::int64_t worst_ns() const { return std::max(worst_early_ns, worst_late_ns); }
};

/// Finds each sample in `truths` by its angular velocity; these are random numbers, or count.
inline Comparison compare(const std::vector<ImuSample>& samples, const std::vector<Truth>& truths, Span delay) {
  Comparison result;
  std::size_t next = 0;
  for (const ImuSample& sample : samples) {
    const auto is_it = [&](const Truth& truth) {
      for (std::size_t i = 0; i < 3; ++i)
        if (std::abs(truth.gyro_rad_s[i] - sample.angular_velocity_rad_s[i]) >
            2e-6 * std::abs(truth.gyro_rad_s[i]) + 1e-9)
          return false;
      return true;
    };
    std::size_t at = next;
    while (at < truths.size() && !is_it(truths[at])) ++at;
    if (at == truths.size()) {
      ++result.unknown;
      continue;
    }
    if (result.samples > 0) result.missing += at - next;
    next = at + 1;
    ++result.samples;
    const std::int64_t error_ns = sample.stamp.ns + delay.ns - truths[at].taken_ns;
    result.worst_early_ns = std::max(result.worst_early_ns, -error_ns);
    result.worst_late_ns = std::max(result.worst_late_ns, error_ns);
    for (std::size_t i = 0; i < 3; ++i)
      result.worst_accel_m_s2 =
          std::max(result.worst_accel_m_s2, std::abs(truths[at].accel_m_s2[i] - sample.specific_force_m_s2[i]));
  }
  return result;
}

/// Reads for a while; counts heap calls of the reading alone.
struct Reading {
  std::vector<ImuSample> samples;
  std::size_t failed = 0;
  std::uint64_t heap_calls = 0;  ///< the models' included
};
inline void read_for(SpiImu& imu, SpiWorld& world, Span duration, Reading& reading) {
  std::vector<ImuSample> some(16);
  reading.samples.reserve(1'000'000);
  const std::int64_t until = world.now_ns + duration.ns;
  while (world.now_ns < until) {
    std::size_t count = 0;
    const HeapCallScope scope;
    const ReadOutcome outcome = imu.read(some, count, Span{std::min<std::int64_t>(100'000'000, until - world.now_ns)});
    reading.heap_calls += scope.calls();
    if (outcome == ReadOutcome::kFailed) ++reading.failed;
    reading.samples.insert(reading.samples.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
  }
}

inline std::string text(const Status& status) { return status ? "well" : status.error().text(); }

/// A driver on the model of its chip. The rig of a chip makes the chip on the model's wires.
template <class Model>
struct ChipRig {
  ChipRig(const ImuDeviceConfig& settings, const WorldSettings& world_settings)
      : config(settings), world(std::make_shared<SpiWorld>(world_settings)), model(*world) {}
  void make_imu(std::unique_ptr<ImuChip> chip, bool has_line) {
    std::unique_ptr<ModelLine> ready;
    if (has_line) ready = std::make_unique<ModelLine>(model);
    line = ready.get();
    model.line_is_rising = config.ready_edge == 0;
    imu = std::make_unique<SpiImu>(config, std::move(chip), std::move(ready), world);
  }
  /// And reads for so many seconds.
  void open(double seconds = 0) {
    ASSERT_EQ(text(imu->open()), "well");
    read_for(seconds);
  }
  void read_for(double seconds) { test::read_for(*imu, *world, Span::from_seconds(seconds), reading); }
  Comparison compared() const { return compare(reading.samples, model.truths, imu->facts().gyroscope_delay); }
  /// Nobody reads for a while.
  void stall(std::int64_t ms) {
    world->now_ns += ms * 1'000'000;
    model.run(world->now_ns);
  }

  ImuDeviceConfig config;
  std::shared_ptr<SpiWorld> world;
  Model model;
  ModelLine* line = nullptr;
  std::unique_ptr<SpiImu> imu;
  Reading reading;
};

inline ImuDeviceConfig at_rate(double hz) {
  ImuDeviceConfig config;
  config.rate_hz = hz;
  return config;
}

}  // namespace epiline::test
