#include "drivers/links/can/can_output.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace epiline {

namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kStatusPeriod_ns = 200 * kMs;
constexpr std::int64_t kFullQueue_ns = 1 * kMs;    // until another attempt
constexpr std::int64_t kBusOff_ns = 1'000 * kMs;   // until another attempt, if nobody says that the bus is back
constexpr std::int64_t kLongest_ns = 1'000 * kMs;  // without a look
constexpr double kDeviations_hz = 5;
constexpr int kPriority = 65;
constexpr int kMostIdentifier = 0x7ff, kMessageIdentifiers = static_cast<int>(can::kMessages.size());

}  // namespace

CanOutput::CanOutput(CanConfig config, const Mat3& R_VB, SystemCalls& system)
    : config_(std::move(config)),
      R_VB_(R_VB),
      stream_(config_.rate_hz),
      system_(system),
      writer_(config_.base_id, config_.fd),
      deviations_every_(std::max(1, static_cast<int>(std::lround(config_.rate_hz / kDeviations_hz)))) {}

// ---- start and end ----

Status CanOutput::check_settings() const {
  const auto error = [](std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, "[can]", 0, std::move(found), std::move(expected)};
  };
  const int last = config_.base_id + kMessageIdentifiers - 1;
  if (config_.interface.empty()) return error("interface is not set", "can.interface, as `ip -br link` shows it");
  if (config_.base_id < 1 || last > kMostIdentifier)
    return error("base_id " + std::to_string(config_.base_id),
                 "1 to " + std::to_string(kMostIdentifier - kMessageIdentifiers + 1));
  if (!(config_.rate_hz > 0)) return error("rate_hz " + std::to_string(config_.rate_hz), "more than 0");
  return Done{};
}

Status CanOutput::begin() {
  if (const Status settings = check_settings(); !settings) return settings;
  if (const DeviceTrouble trouble = open_socket()) return error_of(trouble, config_.interface);
  if (!wake_up_.open()) return Error{ErrorKind::kRun, config_.interface, 0, std::strerror(errno), ""};
  bus_.store(BusState::kActive, std::memory_order_relaxed);
  usable_ = true;
  stop_.store(false, std::memory_order_release);
  return Done{};
}

Status CanOutput::open() {
  if (Status status = begin(); !status) return status;
  if (!thread_.start({"can", kPriority}, run, this)) {
    close();
    return Error{ErrorKind::kRun, config_.interface, 0, "cannot start a thread", "a free thread (ulimit -u)"};
  }
  return Done{};
}

void CanOutput::close() noexcept {
  stop_.store(true, std::memory_order_release);
  wake_up_.notify();
  thread_.join();
  wake_up_.close();
  socket_.close();
}

void CanOutput::run(void* self) {
  auto& output = *static_cast<CanOutput*>(self);
  const ThreadCosts before = costs_of_this_thread();
  while (!output.stopping()) output.turn();
  output.costs_ = costs_of_this_thread() - before;
}

bool CanOutput::publish(const Odometry& odometry) noexcept {
  stream_.offer(odometry, system_.now_ns());
  wake_up_.notify();
  return bus() != BusState::kLost;
}

bool CanOutput::publish_image(const Odometry& odometry) noexcept {
  stream_.offer_image(odometry);
  return bus() != BusState::kLost;
}

// ---- the thread ----

void CanOutput::turn() noexcept {
  wait();
  const std::int64_t now_ns = system_.now_ns();
  usable_ = is_usable(now_ns);
  stream_.look(now_ns, usable_);
  stream_.count_dropped(now_ns, !usable_);
  note_status();
  if (!usable_ || now_ns > pending_until_ns_) drop_pending();
  if (usable_ && now_ns >= stream_.due_ns()) begin_epoch(now_ns);
  send_pending();
  if (status_wanted_ || now_ns >= status_due_ns_) send_status(now_ns);
  counts_.dropped = stream_.dropped() + epochs_given_up_;
  told_.write(counts_);
}

/// Until something is offered, or has to be done.
void CanOutput::wait() noexcept {
  const std::int64_t span_ns = std::clamp<std::int64_t>(next_event_ns() - system_.now_ns(), 0, kLongest_ns);
  pollfd woken{wake_up_.fd(), POLLIN, 0};
  if (system_.wait({&woken, 1}, Span{span_ns}) > 0) wake_up_.clear();
}

std::int64_t CanOutput::next_event_ns() const noexcept {
  if (has_pending()) return system_.now_ns() + kFullQueue_ns;
  if (!socket_.is_open()) return retry_.due_ns();
  return usable_ ? std::min(status_due_ns_, stream_.due_ns()) : status_due_ns_;
}

/// Reopens a lost interface, listens to it, and says whether it is worth while to send.
bool CanOutput::is_usable(std::int64_t now_ns) noexcept {
  if (!socket_.is_open()) {
    if (now_ns < retry_.due_ns()) return false;
    if (const DeviceTrouble trouble = open_socket()) {
      ++counts_.retries;
      counts_.last_error = trouble.error;
      retry_.failed(now_ns);
      return false;
    }
    bus_.store(BusState::kActive, std::memory_order_relaxed);
    silent_until_ns_ = 0;
    status_wanted_ = true;
  }
  listen(now_ns);
  return socket_.is_open() && now_ns >= silent_until_ns_;
}

DeviceTrouble CanOutput::open_socket() noexcept { return socket_.open_to_send(config_.interface.c_str(), config_.fd); }

void CanOutput::lose(int error) noexcept {
  ++counts_.disconnected;
  counts_.last_error = error;
  bus_.store(BusState::kLost, std::memory_order_relaxed);
  drop_pending();
  socket_.close();
  retry_.begin(system_.now_ns());
  retry_.failed(system_.now_ns());
}

void CanOutput::listen(std::int64_t now_ns) noexcept {
  const can::BusNews news = socket_.news();
  counts_.error_frames += news.error_frames;
  if (news.restarted) {
    ++counts_.restarts;
    silent_until_ns_ = 0;
    status_wanted_ = true;
  }
  if (news.bus_off) {
    ++counts_.bus_off;
    silent_until_ns_ = now_ns + kBusOff_ns;
    bus_.store(BusState::kOff, std::memory_order_relaxed);
  } else if (news.error_passive) {
    bus_.store(BusState::kPassive, std::memory_order_relaxed);
  } else if (news.restarted || (news.error_active && bus() == BusState::kPassive) ||
             (bus() == BusState::kOff && now_ns >= silent_until_ns_)) {
    bus_.store(BusState::kActive, std::memory_order_relaxed);
  }
  if (news.error != 0) lose(news.error);
}

// ---- what goes out ----

void CanOutput::note_status() noexcept {
  const can::Values before = status_;
  const bool is_silent = stream_.condition() == Condition::kSilent;
  status_ = can::values_of(stream_.health(), stream_.reset_counter());
  if (is_silent) {
    status_[can::Quantity::kState] = can::kSilent;
    status_[can::Quantity::kQuality] = std::numeric_limits<double>::quiet_NaN();
  }
  for (const auto q : {can::Quantity::kState, can::Quantity::kReasons, can::Quantity::kResetCounter})
    status_wanted_ = status_wanted_ || status_[q] != before[q];
}

/// What is left of the epoch before is given up.
void CanOutput::begin_epoch(std::int64_t now_ns) noexcept {
  const Offer& offer = stream_.next();
  drop_pending();
  pending_ = writer_.odometry(can::values_of(offer.odometry, R_VB_, stream_.reset_counter(), HostStamp{now_ns}),
                              epochs_begun_++ % static_cast<unsigned>(deviations_every_) == 0);
  pending_until_ns_ = offer.offered_ns + OdometryStream::kTooOld_ns;
  stream_.begun(now_ns);
}

/// As many of the epoch's frames as find room; the rest waits for the next turn, or for a newer epoch to replace it.
void CanOutput::send_pending() noexcept {
  while (has_pending() && hand_over(pending_[next_pending_])) {
    ++next_pending_;
    if (has_pending()) continue;
    ++counts_.epochs;
    stream_.finished(system_.now_ns());
  }
}

void CanOutput::drop_pending() noexcept {
  if (has_pending()) ++epochs_given_up_;
  counts_.frames_dropped += pending_.size() - next_pending_;
  pending_.clear();
  next_pending_ = 0;
}

void CanOutput::send_status(std::int64_t now_ns) noexcept {
  status_due_ns_ = now_ns + kStatusPeriod_ns;
  if (!socket_.is_open() || now_ns < silent_until_ns_) return;
  if (!hand_over(writer_.status(status_))) return;
  status_wanted_ = false;
  ++counts_.status_frames;
}

/// False: no room now, or the interface is lost.
bool CanOutput::hand_over(const can::Frame& frame) noexcept {
  const int error = socket_.send(frame);
  if (error == 0) {
    ++counts_.frames;
    return true;
  }
  if (error == EAGAIN || error == ENOBUFS) {
    ++counts_.queue_full;
  } else {
    lose(error);
  }
  return false;
}

}  // namespace epiline
