#pragma once
// An IMU on an SPI bus: what all chips have in common. docs/imu.md
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "drivers/sensors/imu/accel_merge.h"
#include "drivers/sensors/imu/spi_bus.h"
#include "drivers/sensors/imu/spi_imu_clock.h"
#include "pipeline/config/devices.h"
#include "platform/concurrency/snapshot.h"
#include "platform/memory/fixed_vector.h"
#include "platform/ports/counter.h"
#include "platform/ports/ports.h"
#include "platform/time/backoff.h"

namespace epiline {

/// What the thread waits with. Tests bring a time of their own.
class SpiTiming {
 public:
  virtual ~SpiTiming() = default;
  virtual HostStamp now() noexcept;
  virtual void sleep_until(HostStamp instant) noexcept;
};

enum class ReadyOutcome : std::uint8_t { kEdge, kTimeout, kFailed };

/// The data-ready line. open() belongs to start-up and to reopening.
class DataReady {
 public:
  virtual ~DataReady() = default;
  virtual Status open() = 0;
  virtual void close() noexcept = 0;
  /// The oldest edge not given out yet; a time-out of 0 does not wait.
  virtual ReadyOutcome wait(Span timeout, HostStamp& edge) noexcept = 0;
};

/// One sample of a chip, on its own clock, in SI units and the chip's axes.
struct ChipSample {
  DeviceStamp device;
  std::array<double, 3> angular_velocity_rad_s{};
  std::array<double, 3> specific_force_m_s2{};  ///< not of chips with two clocks
};
struct ChipAccel {
  DeviceStamp device;
  std::array<double, 3> specific_force_m_s2{};
};

/// What one look into a chip gave.
struct ChipBatch {
  static constexpr std::size_t kMost = 256;
  FixedVector<ChipSample, kMost> samples;
  FixedVector<ChipAccel, kMost> accels;  ///< of a chip whose accelerometer has a clock of its own
  HostStamp latched;                     ///< a time at which all of `samples` were in the chip already
  DeviceStamp accel_now;                 ///< the accelerometer's clock ...
  HostStamp accel_latched;               ///< ... not after this time
  bool has_accel_now = false;
  std::uint32_t damaged = 0;  ///< packets that cannot be right
  std::uint32_t lost = 0;     ///< samples that were not read in time
  double temperature_c = 0;
  bool has_temperature = false;
  void clear() noexcept;
};

enum class FetchOutcome : std::uint8_t {
  kOk,         ///< perhaps nothing new
  kOverflow,   ///< the FIFO ran over and was emptied; what comes next is another run of samples
  kDamaged,    ///< nothing usable; the FIFO was emptied
  kGarbled,    ///< nothing usable this time
  kReset,      ///< the chip has lost its settings
  kBusFailed,  ///< `bus_error()` of the chip
};

struct ChipFacts {
  const char* name = "";
  Span period;  ///< of samples, nominal
  double rate_hz = 0;
  Span gyroscope_delay, accelerometer_delay;  ///< from the motion to the sample, by the data sheet
  Span settle;                                ///< time after the start during which samples are invalid
  double gyroscope_range_deg_s = 0, accelerometer_range_g = 0;
  double clock_tolerance = 0;  ///< of the counter in its samples, as a share; 0: it has none, or none is known
  bool two_clocks = false;     ///< the accelerometer has its own
  Span accelerometer_period;
};

/// A kind of chip. All calls from one thread; no heap, no exceptions after construction.
class ImuChip {
 public:
  virtual ~ImuChip() = default;
  const ChipFacts& facts() const noexcept { return facts_; }
  /// What of the settings this chip cannot do; said before anything is opened.
  const DeviceTrouble& unfit() const noexcept { return unfit_; }
  int bus_error() const noexcept { return bus_error_; }  ///< errno of the last transfer; 0: it worked
  virtual DeviceTrouble open() noexcept = 0;             ///< opens the bus and checks the identity
  virtual void close() noexcept = 0;

  struct Step {
    DeviceTrouble trouble{};
    Span wait{};  ///< before the next step
    bool done = false;
  };
  /// Reset, settings, start: a step at a time, for some waits are longer than a reader may wait.
  virtual Step start(int step) noexcept = 0;
  virtual FetchOutcome fetch(ChipBatch& batch) noexcept = 0;
  /// The next of the registers, compared with what was written.
  virtual DeviceTrouble check_next() noexcept = 0;
  virtual const char* bus_name() const noexcept = 0;

 protected:
  ChipFacts facts_;
  DeviceTrouble unfit_;
  int bus_error_ = 0;
};

struct SpiImuCounts {
  std::uint64_t samples = 0;       ///< handed out
  std::uint64_t lost = 0;          ///< taken by the chip, not read in time, where the chip counts them
  std::uint64_t overflows = 0;     ///< of the chip's FIFO
  std::uint64_t damaged = 0;       ///< packets or checksums that cannot be right
  std::uint64_t resets = 0;        ///< the chip had lost its settings: a brown-out?
  std::uint64_t not_rising = 0;    ///< stamps not later than the one before: left out
  std::uint64_t unmerged = 0;      ///< gyroscope readings without accelerometer readings around them: left out
  std::uint64_t checked = 0;       ///< registers compared while running
  std::uint64_t disconnected = 0;  ///< the device was lost
  std::uint64_t retries = 0;       ///< attempts to get it back that failed
  std::int64_t last_error = 0;     ///< errno of the last loss or failed attempt; 0: it was silent, or not as before
  double temperature_c = 0;
  double clock_rate = 0;  ///< of the chip's counter, as the driver reads it, against the host's clock; 0: unknown
  SampleClockCounts clock;
};
inline constexpr auto kSpiImuCounters = std::to_array<Counter<SpiImuCounts>>({
    {"readings", &SpiImuCounts::samples},
    {"lost", &SpiImuCounts::lost, true},
    {"overflows", &SpiImuCounts::overflows, true},
    {"damaged", &SpiImuCounts::damaged, true},
    {"resets", &SpiImuCounts::resets, true},
    {"not_rising", &SpiImuCounts::not_rising, true},
    {"unmerged", &SpiImuCounts::unmerged},
    {"registers_checked", &SpiImuCounts::checked},
    {"disconnected", &SpiImuCounts::disconnected, true},
    {"retries", &SpiImuCounts::retries},
});

/// One thread calls open(), read() and close(); any thread may ask for counts. After open() there is no heap call, also
/// when the device is lost and comes back.
class SpiImu final : public ImuSource {
 public:
  /// `ready`: nullptr without a line; then the chip is polled. `timing`: nullptr for the computer's clock.
  SpiImu(const ImuDeviceConfig& config, std::unique_ptr<ImuChip> chip, std::unique_ptr<DataReady> ready,
         std::shared_ptr<SpiTiming> timing);
  ~SpiImu() override { SpiImu::close(); }
  SpiImu(const SpiImu&) = delete;
  SpiImu& operator=(const SpiImu&) = delete;

  /// Returns when the first sample with a sure stamp has come, at most 3 s after the chip has started.
  Status open() override;
  void give_up() noexcept override { gives_up_.store(true, std::memory_order_relaxed); }
  void close() noexcept override;
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override;

  const ChipFacts& facts() const noexcept { return chip_->facts(); }
  SpiImuCounts counts() const noexcept { return published_counts_.read(); }
  /// Of the chip's clock, or of its gyroscope's.
  ClockState clock_state() const noexcept { return published_clock_.read(); }
  bool is_running() const noexcept { return running_.load(std::memory_order_relaxed); }

 private:
  enum class State : std::uint8_t { kLost, kStarting, kRunning };
  struct Waiting {
    HostStamp stamp;
    std::array<double, 3> angular_velocity_rad_s{};
  };
  static constexpr std::size_t kPending = 2 * ChipBatch::kMost;

  // Getting it to run, and losing it.
  Error error_of(const DeviceTrouble& trouble) const;
  Status wait_for_first();
  DeviceTrouble connect() noexcept;
  bool bring_up(HostStamp deadline) noexcept;
  void set_state(State state) noexcept;
  void start_again() noexcept;
  void was_reset() noexcept;
  void begin_run(HostStamp now) noexcept;
  void lose(int error) noexcept;
  void retry_later(int error) noexcept;
  void count_loss(int error) noexcept;

  // A look into the chip.
  bool wait_for_data(HostStamp deadline) noexcept;
  void drain_edges() noexcept;
  void look() noexcept;
  bool registers_are_well(HostStamp now) noexcept;
  void schedule_poll(bool was_empty, HostStamp now) noexcept;
  void take(HostStamp now) noexcept;
  bool accel_is_settled() const noexcept;
  void take_accels() noexcept;
  void merge(HostStamp now) noexcept;
  void put(HostStamp stamp, const std::array<double, 3>& omega, const std::array<double, 3>& force) noexcept;
  std::size_t hand_out(std::span<ImuSample> samples) noexcept;
  void publish() noexcept;

  ImuDeviceConfig config_;
  std::shared_ptr<SpiTiming> timing_;
  std::unique_ptr<ImuChip> chip_;
  std::unique_ptr<DataReady> ready_;
  Span gyroscope_delay_, accelerometer_delay_;

  State state_ = State::kLost;
  bool opened_ = false;
  int step_ = 0;
  DeviceTrouble trouble_;  ///< the last
  HostStamp step_at_, good_from_, last_data_, last_check_, last_look_, next_poll_;
  Backoff retry_{Span::from_milliseconds(50), Span::from_milliseconds(1'000)};
  int damaged_in_a_row_ = 0, empty_looks_ = 0;
  bool edge_seen_ = false, is_counted_as_lost_ = false;

  ChipBatch batch_;
  SampleClock clock_;
  CounterRate counter_rate_;
  OneWaySync accel_sync_;
  AccelMerge<HostClock> merge_;
  std::array<DeviceStamp, ChipBatch::kMost> devices_{};
  std::array<HostStamp, ChipBatch::kMost> stamps_{};
  FixedVector<Waiting, kPending> waiting_;  ///< for the accelerometer
  FixedVector<ImuSample, kPending> pending_;
  std::size_t pending_first_ = 0;
  HostStamp arrival_, last_stamp_;

  SpiImuCounts counts_;
  std::atomic<bool> running_{false}, gives_up_{false};
  Snapshot<SpiImuCounts> published_counts_;
  Snapshot<ClockState> published_clock_;
};

}  // namespace epiline
