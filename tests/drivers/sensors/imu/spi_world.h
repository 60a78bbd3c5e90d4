#pragma once
// A made-up computer with an SPI bus and a data-ready line: time goes on when somebody waits, asks or transfers.
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <deque>
#include <random>
#include <span>

#include "drivers/sensors/imu/spi_bus.h"
#include "drivers/sensors/imu/spi_imu.h"
#include "drivers/sensors/trouble.h"
#include "platform/memory/allocation_count.h"

namespace epiline::test {

/// How late the reading thread is, and what the wires do.
struct WorldSettings {
  unsigned seed = 1;
  double wake_up_us = 20;     ///< usual time from an edge or the end of a sleep to the thread
  double stall_share = 0;     ///< of wake-ups ...
  double stall_most_ms = 0;   ///< ... that take up to this
  double transfer_us = 15;    ///< system call and driver, besides the bytes
  double edge_jitter_us = 5;  ///< of the interrupt
  double edge_lost_share = 0;
  double edge_visible_us = 0;  ///< from the interrupt's time to the edge being there to read
};

class SpiWorld final : public SpiTiming {
 public:
  explicit SpiWorld(const WorldSettings& given) : settings(given), random(given.seed) {}

  HostStamp now() noexcept override {
    now_ns += 300;
    return {now_ns};
  }
  void sleep_until(HostStamp instant) noexcept override {
    if (instant.ns <= now_ns) return;
    now_ns = instant.ns;
    wake_up();
  }
  void wake_up() {
    now_ns += static_cast<std::int64_t>(1e3 * settings.wake_up_us * uniform(0.2, 2));
    if (uniform(0, 1) < settings.stall_share)
      now_ns += static_cast<std::int64_t>(1e6 * uniform(0, settings.stall_most_ms));
  }
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); }

  std::int64_t now_ns = 5'000'000'000'000;  // the computer has been on for a while
  WorldSettings settings;
  std::mt19937 random;
};

/// A chip that takes samples and gives edges. Its own time runs `1 + clock_error` times as fast.
class ChipModel {
 public:
  struct Edge {
    std::int64_t at_ns, visible_ns;
  };
  explicit ChipModel(SpiWorld& in) : world(in) {}
  virtual ~ChipModel() = default;

  /// Everything up to `until_ns` happens.
  virtual void run(std::int64_t until_ns) = 0;
  /// The next sample's time, if nobody changes anything. A far future if there is none.
  virtual std::int64_t next_ns() const = 0;

  void give_edge(std::int64_t at_ns) {
    if (world.uniform(0, 1) < world.settings.edge_lost_share) return;
    const auto jitter = static_cast<std::int64_t>(1e3 * world.uniform(0, world.settings.edge_jitter_us));
    const auto later = static_cast<std::int64_t>(1e3 * world.uniform(0, world.settings.edge_visible_us));
    edges.push_back({at_ns + jitter, at_ns + jitter + later});
  }

  SpiWorld& world;
  std::deque<Edge> edges;  ///< not yet read
  double clock_error = 0;
  std::uint64_t heap_calls = 0;  ///< of the models, when the driver called them
  bool line_is_rising = true;    ///< which edge the computer listens to
  static constexpr std::int64_t kNever = std::int64_t{1} << 60;
};

/// Heap calls of a model are not the driver's.
class ModelScope {
 public:
  explicit ModelScope(ChipModel& chip) : chip_(chip) {}
  ~ModelScope() { chip_.heap_calls += scope_.calls(); }

 private:
  ChipModel& chip_;
  HeapCallScope scope_;
};

class ModelLine final : public DataReady {
 public:
  explicit ModelLine(ChipModel& chip) : chip_(chip) {}
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadyOutcome wait(Span timeout, HostStamp& edge) noexcept override {
    const ModelScope scope(chip_);
    const std::int64_t deadline = chip_.world.now_ns + timeout.ns;
    for (;;) {
      chip_.run(chip_.world.now_ns);
      if (is_cut) chip_.edges.clear();
      if (!chip_.edges.empty() && chip_.edges.front().visible_ns <= chip_.world.now_ns) {
        edge = {chip_.edges.front().at_ns};
        chip_.edges.pop_front();
        return ReadyOutcome::kEdge;
      }
      if (chip_.world.now_ns >= deadline) return ReadyOutcome::kTimeout;
      // the interrupt may come later than the sample
      const std::int64_t next =
          chip_.edges.empty() ? std::max(chip_.next_ns(), chip_.world.now_ns) + 1'000 : chip_.edges.front().visible_ns;
      chip_.world.sleep_until({std::min(next, deadline)});
    }
  }
  bool is_cut = false;

 private:
  ChipModel& chip_;
};

/// Wires of one chip select: bytes go to the chip one after the other.
class ModelBus : public SpiBus {
 public:
  explicit ModelBus(ChipModel& chip) : chip_(chip) {}

  DeviceTrouble open(int mode, int hz) noexcept override {
    mode_ = mode;
    hz_ = hz;
    ++times_opened;
    return refused("open", open_error);
  }
  void close() noexcept override { ++times_closed; }
  const char* name() const noexcept override { return "model"; }

  int transfer(std::span<const SpiPart> parts) noexcept override {
    const ModelScope scope(chip_);
    SpiWorld& world = chip_.world;
    world.now_ns += static_cast<std::int64_t>(1e3 * world.settings.transfer_us * world.uniform(0.3, 1.5));
    if (fail_next > 0) {
      --fail_next;
      return fail_error;
    }
    chip_.run(world.now_ns);
    select();
    for (const SpiPart& part : parts) {
      const int hz = part.hz > 0 ? part.hz : hz_;
      for (std::size_t k = 0; k < part.size; ++k) {
        world.now_ns += 8'000'000'000 / hz;
        chip_.run(world.now_ns);
        const std::uint8_t out = exchange(part.send != nullptr ? part.send[k] : 0, hz);
        if (part.receive != nullptr) part.receive[k] = on_the_wire(out);
      }
    }
    deselect();
    return 0;
  }

  int open_error = 0, fail_next = 0, fail_error = EIO;
  int times_opened = 0, times_closed = 0;
  int stuck = -1;             ///< MISO is this byte always
  double bit_error_rate = 0;  ///< of received bytes

 protected:
  virtual void select() {}
  virtual void deselect() {}
  virtual std::uint8_t exchange(std::uint8_t in, int hz) = 0;

  int mode() const { return mode_; }
  ChipModel& chip_;

 private:
  std::uint8_t on_the_wire(std::uint8_t byte) {
    if (stuck >= 0) return static_cast<std::uint8_t>(stuck);
    if (bit_error_rate > 0 && chip_.world.uniform(0, 1) < bit_error_rate)
      byte ^= static_cast<std::uint8_t>(1 << (chip_.world.random() % 8));
    return byte;
  }
  int mode_ = -1, hz_ = 1;
};

/// The wires of a chip with one chip select.
template <class Model>
class ChipBus final : public ModelBus {
 public:
  explicit ChipBus(Model& chip) : ModelBus(chip), model_(chip) {}

 private:
  void select() override { model_.select(); }
  void deselect() override { model_.deselect(); }
  std::uint8_t exchange(std::uint8_t in, int hz) override { return model_.exchange(in, mode(), hz); }
  Model& model_;
};

/// What a sample must become.
struct Truth {
  std::int64_t taken_ns;  ///< when it was in the chip; the line's edge is later by the interrupt's jitter
  double gyro_rad_s[3];
  double accel_m_s2[3];
};

}  // namespace epiline::test
