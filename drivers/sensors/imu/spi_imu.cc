#include "drivers/sensors/imu/spi_imu.h"

#include <algorithm>
#include <string>
#include <utility>

#include "drivers/sensors/trouble.h"
#include "platform/error/contract.h"
#include "platform/time/monotonic.h"
#include "platform/time/sleep.h"

namespace epiline {

namespace {

constexpr Span kCheckEvery = Span::from_milliseconds(100);
constexpr Span kFirstSampleWithin = Span::from_milliseconds(3'000);
constexpr Span kSilenceLeast = Span::from_milliseconds(200);
constexpr Span kSettleAccel = Span::from_milliseconds(100);
constexpr Span kAskAgain = Span{200'000};
constexpr int kDamagedMost = 10, kEmptyLooksMost = 3;
constexpr std::size_t kEdgesAtOnce = 256;

Span part_of(Span span, double share) noexcept {
  return {static_cast<std::int64_t>(static_cast<double>(span.ns) * share)};
}

}  // namespace

HostStamp SpiTiming::now() noexcept { return {monotonic_ns()}; }

void SpiTiming::sleep_until(HostStamp instant) noexcept {
  while (monotonic_ns() < instant.ns) epiline::sleep_until(instant.ns);  // a signal ends it early
}

void ChipBatch::clear() noexcept {
  samples.clear();
  accels.clear();
  has_accel_now = has_temperature = false;
  damaged = lost = 0;
}

SpiImu::SpiImu(const ImuDeviceConfig& config, std::unique_ptr<ImuChip> chip, std::unique_ptr<DataReady> ready,
               std::shared_ptr<SpiTiming> timing)
    : config_(config),
      timing_(timing ? std::move(timing) : std::make_shared<SpiTiming>()),
      chip_(std::move(chip)),
      ready_(std::move(ready)),
      clock_({chip_->facts().period, ready_ != nullptr}),
      accel_sync_(oscillator_sync(chip_->facts().accelerometer_period, kSettleAccel)),
      merge_(part_of(chip_->facts().accelerometer_period, 4)) {
  const Span more = Span::from_seconds(config_.delay_ms * 1e-3);
  gyroscope_delay_ = chip_->facts().gyroscope_delay + more;
  accelerometer_delay_ = chip_->facts().accelerometer_delay + more;
}

// ---- getting it to run, and losing it ----

Status SpiImu::open() {
  if (const DeviceTrouble trouble = chip_->unfit()) {
    Error error = error_of(trouble);
    error.kind = ErrorKind::kUsage;
    return error;
  }
  if (const DeviceTrouble trouble = connect()) {
    chip_->close();
    return error_of(trouble);
  }
  if (ready_) {
    const Status status = ready_->open();
    if (!status) {
      chip_->close();
      return status;
    }
  }
  opened_ = true;
  edge_seen_ = false;
  const Status status = wait_for_first();
  publish();
  if (!status) close();
  return status;
}

DeviceTrouble SpiImu::connect() noexcept {
  if (const DeviceTrouble trouble = chip_->open()) return trouble;
  start_again();
  return {};
}

void SpiImu::set_state(State state) noexcept {
  state_ = state;
  running_.store(state == State::kRunning, std::memory_order_relaxed);
}

void SpiImu::start_again() noexcept {
  set_state(State::kStarting);
  step_ = 0;
  step_at_ = timing_->now();
}

void SpiImu::was_reset() noexcept {
  ++counts_.resets;
  start_again();
}

Status SpiImu::wait_for_first() {
  HostStamp until;
  for (bool started = false; pending_.empty() || (ready_ && !edge_seen_);) {
    pending_.clear();
    const HostStamp now = timing_->now();
    if (state_ == State::kRunning && !started) {
      started = true;
      until = now + kFirstSampleWithin;
    }
    if ((started && now >= until) || gives_up_.load(std::memory_order_relaxed)) break;
    const HostStamp deadline = now + Span::from_milliseconds(100);
    if (state_ == State::kLost || (state_ == State::kStarting && !bring_up(deadline) && state_ == State::kLost))
      return error_of(trouble_);
    if (state_ == State::kRunning && wait_for_data(deadline)) look();
  }
  const bool edges_missing = ready_ && !edge_seen_;
  if (!pending_.empty() && !edges_missing) return Done{};
  if (!edges_missing) return error_of(device_refusal("no sample within 3 s", 0));
  return error_of(expecting(device_refusal("no data-ready edge within 3 s", 0),
                            "edges on line %.64s. Is it wired to the chip's interrupt pin?",
                            config_.ready_line.c_str()));
}

Error SpiImu::error_of(const DeviceTrouble& trouble) const {
  Error error =
      epiline::error_of(trouble ? trouble : device_refusal("the chip was lost", trouble.error), chip_->bus_name());
  error.found = std::string(chip_->facts().name) + ": " + error.found;
  return error;
}

void SpiImu::close() noexcept {
  gives_up_.store(false, std::memory_order_relaxed);
  chip_->close();
  if (ready_ && opened_) ready_->close();
  opened_ = false;
  set_state(State::kLost);
  pending_.clear();
  pending_first_ = 0;
  waiting_.clear();
}

void SpiImu::lose(int error) noexcept {
  chip_->close();
  count_loss(error);
  set_state(State::kLost);
  retry_.begin(timing_->now().ns);
  waiting_.clear();
}

void SpiImu::count_loss(int error) noexcept {
  if (!is_counted_as_lost_) ++counts_.disconnected;
  is_counted_as_lost_ = true;
  counts_.last_error = error;
}

void SpiImu::retry_later(int error) noexcept {
  chip_->close();
  if (!is_counted_as_lost_) retry_.begin(timing_->now().ns);
  count_loss(error);
  ++counts_.retries;
  set_state(State::kLost);
  retry_.failed(timing_->now().ns);
}

/// False: it does not run yet, and the deadline has come or an attempt has failed.
bool SpiImu::bring_up(HostStamp deadline) noexcept {
  while (state_ != State::kRunning) {
    const HostStamp at = state_ == State::kLost ? HostStamp{retry_.due_ns()} : step_at_;
    if (timing_->now() < at) {
      timing_->sleep_until(std::min(at, deadline));
      if (timing_->now() < at) return false;
    }
    if (state_ == State::kLost) {
      trouble_ = connect();
      if (trouble_) {
        retry_later(trouble_.error);
        return false;
      }
      continue;
    }
    const ImuChip::Step step = chip_->start(step_);
    if (step.trouble) {
      trouble_ = step.trouble;
      retry_later(step.trouble.error);
      return false;
    }
    ++step_;
    step_at_ = timing_->now() + step.wait;
    if (step.done) begin_run(timing_->now());
  }
  return true;
}

void SpiImu::begin_run(HostStamp now) noexcept {
  set_state(State::kRunning);
  is_counted_as_lost_ = false;
  good_from_ = now + chip_->facts().settle;
  last_data_ = last_check_ = last_look_ = next_poll_ = now;
  damaged_in_a_row_ = empty_looks_ = 0;
  accel_sync_ = OneWaySync(oscillator_sync(chip_->facts().accelerometer_period, kSettleAccel));
  merge_.restart(part_of(chip_->facts().accelerometer_period, 4));
  waiting_.clear();
  clock_.restart();
  drain_edges();
  clock_.restart();  // those edges were of samples that are gone
}

// ---- a look into the chip ----

ReadOutcome SpiImu::read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept {
  EPILINE_EXPECTS(opened_ && !samples.empty(), "open() before read(), and room for a sample");
  count = hand_out(samples);
  if (count > 0) return ReadOutcome::kSample;
  const HostStamp deadline = timing_->now() + timeout;
  for (;;) {
    const bool runs = state_ == State::kRunning || bring_up(deadline);
    if (runs && wait_for_data(deadline)) look();
    count = hand_out(samples);
    publish();
    if (count > 0) return ReadOutcome::kSample;
    if (!runs || state_ == State::kLost) return ReadOutcome::kFailed;
    if (timing_->now() >= deadline) return state_ == State::kRunning ? ReadOutcome::kTimeout : ReadOutcome::kFailed;
  }
}

/// True: the chip is to be asked now. An edge whose sample was read already is no reason.
bool SpiImu::wait_for_data(HostStamp deadline) noexcept {
  const HostStamp until = std::min(deadline, next_poll_);
  if (!ready_) {
    timing_->sleep_until(until);
    return timing_->now() >= next_poll_;
  }
  for (;;) {
    HostStamp edge;
    const ReadyOutcome outcome = ready_->wait(std::max(Span{}, until - timing_->now()), edge);
    if (outcome == ReadyOutcome::kFailed) timing_->sleep_until(until);  // then it is polled
    if (outcome != ReadyOutcome::kEdge) return timing_->now() >= next_poll_;
    edge_seen_ = true;
    if (clock_.is_old(edge)) {
      if (timing_->now() >= until) return timing_->now() >= next_poll_;
      continue;
    }
    clock_.add_edge(edge);
    // a line that floats gives edges without end; the chip is not asked more often than makes sense
    const HostStamp earliest = last_look_ + part_of(chip_->facts().period, 0.125);
    if (timing_->now() < earliest) timing_->sleep_until(earliest);
    return true;
  }
}

void SpiImu::drain_edges() noexcept {
  HostStamp edge;
  for (std::size_t i = 0; ready_ && i < kEdgesAtOnce && ready_->wait(Span{}, edge) == ReadyOutcome::kEdge; ++i) {
    edge_seen_ = true;
    if (!clock_.is_old(edge)) clock_.add_edge(edge);
  }
}

void SpiImu::look() noexcept {
  last_look_ = timing_->now();
  batch_.clear();
  const FetchOutcome outcome = chip_->fetch(batch_);
  const HostStamp now = timing_->now();
  counts_.damaged += batch_.damaged;
  counts_.lost += batch_.lost;
  if (batch_.has_temperature) counts_.temperature_c = batch_.temperature_c;
  schedule_poll(outcome == FetchOutcome::kOk && batch_.samples.empty(), now);
  if (outcome == FetchOutcome::kBusFailed) return lose(chip_->bus_error());
  if (outcome == FetchOutcome::kReset) return was_reset();
  if (outcome == FetchOutcome::kOverflow) ++counts_.overflows;
  const bool is_damaged = outcome == FetchOutcome::kDamaged || outcome == FetchOutcome::kGarbled;
  if (is_damaged && ++damaged_in_a_row_ >= kDamagedMost) return lose(EIO);
  if (!registers_are_well(now)) return;
  drain_edges();
  if (outcome == FetchOutcome::kOverflow || outcome == FetchOutcome::kDamaged) {
    clock_.restart();
  } else if (!batch_.samples.empty() || !batch_.accels.empty()) {
    take(now);
  }
  const Span silence = std::max(kSilenceLeast, Span{20 * chip_->facts().period.ns});
  if (now - last_data_ > silence) lose(0);
}

void SpiImu::schedule_poll(bool was_empty, HostStamp now) noexcept {
  const Span period = chip_->facts().period;
  if (!ready_) {
    // an irrational share: the time from sample to look takes all values, soon one near 0
    next_poll_ = std::max(next_poll_ + part_of(period, 0.618), now);
    return;
  }
  empty_looks_ = was_empty ? empty_looks_ + 1 : 0;
  // the edge can come a moment before the sample can be read
  const bool ask_again = was_empty && empty_looks_ <= kEmptyLooksMost;
  next_poll_ = now + (ask_again ? std::min(kAskAgain, part_of(period, 0.2)) : part_of(period, 1.618));
}

/// False: they are not, and the samples that were read are not to be trusted.
bool SpiImu::registers_are_well(HostStamp now) noexcept {
  if (now - last_check_ < kCheckEvery) return true;
  last_check_ = now;
  const DeviceTrouble trouble = chip_->check_next();
  ++counts_.checked;
  if (!trouble) return true;
  trouble_ = trouble;
  trouble.error != 0 ? lose(trouble.error) : was_reset();
  return false;
}

void SpiImu::take(HostStamp now) noexcept {
  arrival_ = batch_.latched;
  if (chip_->facts().two_clocks) take_accels();
  const std::size_t n = batch_.samples.size();
  for (std::size_t i = 0; i < n; ++i) devices_[i] = batch_.samples[i].device;
  if (n > 0) {
    last_data_ = now, damaged_in_a_row_ = 0;
    counter_rate_.add(devices_[n - 1], batch_.latched);
  }
  const bool is_good = now >= good_from_ && (!chip_->facts().two_clocks || accel_is_settled());
  if (clock_.stamp({devices_.data(), n}, batch_.latched, stamps_) && is_good) {
    for (std::size_t i = 0; i < n; ++i) {
      const ChipSample& sample = batch_.samples[i];
      const HostStamp stamp = stamps_[i] - gyroscope_delay_;
      if (!chip_->facts().two_clocks) {
        put(stamp, sample.angular_velocity_rad_s, sample.specific_force_m_s2);
      } else if (!waiting_.push_back({stamp, sample.angular_velocity_rad_s})) {
        ++counts_.unmerged;
      }
    }
  }
  if (chip_->facts().two_clocks) merge(now);
}

bool SpiImu::accel_is_settled() const noexcept { return accel_sync_.state().window >= kSettleAccel; }

void SpiImu::take_accels() noexcept {
  if (batch_.has_accel_now) accel_sync_.update(batch_.accel_now, batch_.accel_latched);
  if (!accel_is_settled()) return;
  for (const ChipAccel& accel : batch_.accels)
    merge_.add(accel_sync_.translate(accel.device) - accelerometer_delay_, accel.specific_force_m_s2);
}

void SpiImu::merge(HostStamp now) noexcept {
  const Span patience = Span::from_milliseconds(20) + Span{8 * chip_->facts().accelerometer_period.ns};
  std::size_t done = 0;
  for (; done < waiting_.size(); ++done) {
    std::array<double, 3> force{};
    const Waiting& reading = waiting_[done];
    const AccelMerge<HostClock>::Outcome outcome = merge_.value_at(reading.stamp, force);
    if (outcome == AccelMerge<HostClock>::Outcome::kWait && now - reading.stamp < patience + gyroscope_delay_) break;
    if (outcome == AccelMerge<HostClock>::Outcome::kMerged) {
      put(reading.stamp, reading.angular_velocity_rad_s, force);
    } else {
      ++counts_.unmerged;
    }
  }
  std::copy(waiting_.begin() + done, waiting_.end(), waiting_.begin());
  waiting_.resize(waiting_.size() - done);
}

void SpiImu::put(HostStamp stamp, const std::array<double, 3>& omega, const std::array<double, 3>& force) noexcept {
  if (stamp <= last_stamp_) {
    ++counts_.not_rising;
    return;
  }
  ImuSample sample;
  sample.stamp = stamp;
  sample.angular_velocity_rad_s = omega;
  sample.specific_force_m_s2 = force;
  sample.arrival = arrival_;
  if (!pending_.push_back(sample)) {
    ++counts_.lost;
    return;
  }
  last_stamp_ = stamp;
}

std::size_t SpiImu::hand_out(std::span<ImuSample> samples) noexcept {
  const std::size_t n = std::min(samples.size(), pending_.size() - pending_first_);
  std::copy_n(pending_.begin() + pending_first_, n, samples.begin());
  pending_first_ += n;
  counts_.samples += n;
  if (pending_first_ == pending_.size()) {
    pending_.clear();
    pending_first_ = 0;
  }
  return n;
}

void SpiImu::publish() noexcept {
  counts_.clock = clock_.counts();
  counts_.clock_rate = counter_rate_.rate();
  published_counts_.write(counts_);
  published_clock_.write(clock_.state());
}

}  // namespace epiline
