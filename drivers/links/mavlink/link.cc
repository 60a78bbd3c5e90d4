#include "drivers/links/mavlink/link.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/links/mavlink/serial_port.h"
#include "drivers/links/mavlink/udp_port.h"
#include "platform/error/contract.h"
#include "platform/time/monotonic.h"

namespace epiline::mavlink {

namespace {

constexpr std::int64_t kMillisecond_ns = 1'000'000;
// 3 Mbaud bring 300 kB/s. More is an attack or a fault, and must not take a processor at this priority.
constexpr double kInputPerSecond = 500'000, kInputAtOnce = 32'768;
constexpr std::size_t kReadAtOnce = 4096;
constexpr double kReadCost = 32;  // bytes that a read counts for besides its own: datagrams may be empty
constexpr std::int64_t kQuestions_ns = 1'000'000'000, kQuestionsForImu_ns = 100 * kMillisecond_ns;
constexpr std::int64_t kLineCheck_ns = kMillisecond_ns;  // how soon to look at a full line again
constexpr double kOdometryFrame = 10 + 233 + 2, kOtherBytesPerSecond = 1500;

bool is_serial(const MavlinkConfig& config) { return !config.serial.empty(); }

}  // namespace

MavlinkLink::MavlinkLink(const MavlinkConfig& config, const Mat3& R_VB, const std::optional<ImuDeviceConfig>& imu,
                         int priority, SystemCalls& system)
    : config_(config),
      R_VB_(R_VB),
      priority_(priority),
      system_(system),
      stream_(config.rate_hz),
      local_frame_(config),
      own_(address_of(config)),
      question_period_ns_(imu ? kQuestionsForImu_ns : kQuestions_ns),
      timesync_(own_),
      input_(kInputPerSecond, kInputAtOnce) {
  if (!imu) return;
  imu_.emplace(Span::from_seconds(1e-3 * imu->delay_ms));
  imu_request_.emplace(imu->rate_hz);
}

void MavlinkLink::want_heights(const std::array<bool, kHeightKinds>& kinds, double air_deg) {
  heights_.emplace(air_deg);
  height_request_.emplace(kinds);
  question_period_ns_ = kQuestionsForImu_ns;
}

// ---- opening and closing ----

Status MavlinkLink::check() const {
  if (config_.serial.empty() == config_.udp.empty())
    return Error{ErrorKind::kUsage, "[mavlink]", 0,
                 config_.serial.empty() ? "neither serial nor udp is set" : "both serial and udp are set",
                 "one of them"};
  if (Status status = fault_of_frame(config_); !status) return status;
  const double signature = config_.signing_key_file.empty() ? 0 : static_cast<double>(kSignature);
  const double bytes = config_.rate_hz * (kOdometryFrame + signature) + kOtherBytesPerSecond;
  if (is_serial(config_) && 10 * bytes > config_.baud)
    return Error{ErrorKind::kUsage, "mavlink.baud", 0,
                 std::to_string(config_.baud) + " for " + std::to_string(static_cast<int>(config_.rate_hz)) +
                     " odometry messages per second",
                 "at least " + std::to_string(static_cast<int>(10 * bytes)) + ", or a lower mavlink.rate_hz"};
  if (imu_ && !R_VB_.isIdentity(1e-9))
    return Error{ErrorKind::kUsage, "[body]", 0, "angles with imu.driver = \"mavlink\"",
                 "angles of 0: a flight controller sends its samples in the vehicle's axes"};
  return Done{};
}

Result<std::unique_ptr<Port>> MavlinkLink::make_port() const {
  if (is_serial(config_))
    return std::unique_ptr<Port>(std::make_unique<SerialPort>(config_.serial, config_.baud, system_));
  const auto peer = udp_address(config_.udp, "mavlink.udp");
  if (!peer) return peer.error();
  sockaddr_in own{};
  if (!config_.udp_listen.empty()) {
    const auto given = udp_address(config_.udp_listen, "mavlink.udp_listen");
    if (!given) return given.error();
    own = *given;
  }
  return std::unique_ptr<Port>(std::make_unique<UdpPort>(config_.udp, *peer, own, system_));
}

Status MavlinkLink::begin() {
  EPILINE_EXPECTS(!wake_up_.is_open(), "open() once");
  if (Status status = check(); !status) return status;
  if (!config_.signing_key_file.empty()) {
    const auto key = read_signing_key(config_.signing_key_file);
    if (!key) return key.error();
    signing_.emplace(*key);
  }
  auto port = make_port();
  if (!port) return port.error();
  port_ = std::move(*port);
  if (const DeviceTrouble trouble = port_->open()) return error_of(trouble, port_->name());
  if (!wake_up_.open()) return Error{ErrorKind::kRun, "eventfd", 0, std::strerror(errno), ""};
  opened_ns_ = system_.now_ns();
  state_.is_open = true;
  is_open_.store(true, std::memory_order_relaxed);
  stop_.store(false, std::memory_order_relaxed);
  told_.write(state_);
  return Done{};
}

Status MavlinkLink::open() {
  if (Status status = begin(); !status) return status;
  if (!thread_.start({"mavlink", priority_}, run, this)) {
    close();
    return Error{ErrorKind::kRun, "mavlink", 0, "cannot start a thread", "a free thread (ulimit -u)"};
  }
  return Done{};
}

void MavlinkLink::close() noexcept {
  if (!wake_up_.is_open()) return;
  stop_.store(true, std::memory_order_relaxed);
  wake_up_.notify();
  thread_.join();
  port_->close();
  wake_up_.close();
  is_open_.store(false, std::memory_order_relaxed);
}

// ---- the publishing thread ----

bool MavlinkLink::publish(const epiline::Odometry& odometry) noexcept {
  stream_.offer(odometry, system_.now_ns());
  wake_up_.notify();
  return is_open_.load(std::memory_order_relaxed);
}

bool MavlinkLink::publish_image(const epiline::Odometry& odometry) noexcept {
  stream_.offer_image(odometry);
  return is_open_.load(std::memory_order_relaxed);
}

// ---- the thread that reads the IMU ----

ReadOutcome MavlinkLink::read_imu(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept {
  count = 0;
  has_reader_.store(true, std::memory_order_relaxed);
  readings_parking_.wait_until(monotonic_ns() + timeout.ns, [&] { return readings_.front() != nullptr; });
  while (count < samples.size() && readings_.pop(samples[count])) ++count;
  if (count > 0) return ReadOutcome::kSample;
  return is_open_.load(std::memory_order_relaxed) ? ReadOutcome::kTimeout : ReadOutcome::kFailed;
}

ReadOutcome MavlinkLink::read_height(HeightSample& sample, Span timeout) noexcept {
  has_height_reader_.store(true, std::memory_order_relaxed);
  heights_parking_.wait_until(monotonic_ns() + timeout.ns, [&] { return heights_read_.front() != nullptr; });
  if (heights_read_.pop(sample)) return ReadOutcome::kSample;
  return is_open_.load(std::memory_order_relaxed) ? ReadOutcome::kTimeout : ReadOutcome::kFailed;
}

// ---- the link's thread ----

void MavlinkLink::run(void* self) {
  auto& link = *static_cast<MavlinkLink*>(self);
  link.costs_at_start_ = costs_of_this_thread();
  while (!link.stop_.load(std::memory_order_relaxed)) link.turn();
  link.next_latency_ns_ = 0;
  link.tell(link.system_.now_ns());
}

void MavlinkLink::turn() noexcept {
  const std::int64_t now_ns = system_.now_ns();
  keep_port(now_ns);
  if (state_.is_open) read_port(now_ns);
  look_at_estimate(now_ns);
  if (state_.is_open) write_port();
  tell(now_ns);
  wait();
}

void MavlinkLink::wait() noexcept {
  const std::int64_t now_ns = system_.now_ns();
  const std::int64_t span_ns = std::clamp<std::int64_t>(next_event_ns(now_ns) - now_ns, 0, kSecond_ns);
  const bool reads = input_.available(now_ns) >= 1;
  const auto events = static_cast<short>((reads ? POLLIN : 0) | (is_frame_waiting() ? POLLOUT : 0));
  std::array<pollfd, 2> files{{{wake_up_.fd(), POLLIN, 0}, {port_->fd(), events, 0}}};
  // a port that hung up would end every wait at once: it is asked only if somebody hears what it says
  system_.wait({files.data(), state_.is_open && reads ? 2U : 1U}, Span{span_ns});
  if (files[0].revents != 0) wake_up_.clear();
}

std::int64_t MavlinkLink::next_event_ns(std::int64_t now_ns) const noexcept {
  if (!state_.is_open) return retry_.due_ns();
  const std::int64_t input_ns = input_.ready_ns(1);
  const std::int64_t next_ns = std::min(input_ns > now_ns ? input_ns : kFar_ns, stream_.silent_ns());
  if (is_frame_waiting()) return next_ns;  // nothing else can be sent
  std::int64_t send_ns = std::min({next_heartbeat_ns_, news_.due_ns(), odometry_due_ns(), heights_due_ns()});
  if (timesync_.owes_answer()) send_ns = now_ns;  // one the line had no room for
  if (state_.peer.is_known) send_ns = std::min({send_ns, next_question_ns_, survey_.due_ns()});
  if (state_.peer.is_known && imu_request_) send_ns = std::min(send_ns, imu_request_->due_ns());
  if (wants_origin()) send_ns = std::min(send_ns, next_origin_ns_);
  if (is_paused_) send_ns = std::min(send_ns, pause_until_ns_);
  if (backlog_ > kOdometryBehind) send_ns = std::max(send_ns, now_ns + kLineCheck_ns);
  return std::min(next_ns, send_ns);
}

void MavlinkLink::tell(std::int64_t now_ns) noexcept {
  LinkCounts& counts = state_.counts;
  counts.packets = parser_.packets();
  counts.bad_checksums = parser_.bad_checksums();
  counts.skipped_bytes = parser_.skipped_bytes();
  counts.refused_questions = timesync_.refused_questions();
  counts.refused_answers = timesync_.refused_answers();
  counts.dropped = stream_.dropped();
  state_.clock = timesync_.clock().state();
  if (imu_) {
    state_.imu = imu_->counts();
    state_.imu_request = imu_request_->state();
  }
  if (heights_) state_.heights = heights_->counts();
  state_.answers = survey_.answers();
  if (now_ns - last_odometry_ns_ > kSecond_ns) state_.sending_since = {};
  if (now_ns >= next_latency_ns_) {
    next_latency_ns_ = now_ns + kSecond_ns;
    state_.costs = costs_of_this_thread() - costs_at_start_;
    told_latency_.write(stream_.latency());
  }
  told_.write(state_);
}

// ---- the port ----

void MavlinkLink::keep_port(std::int64_t now_ns) noexcept {
  if (state_.is_open || now_ns < retry_.due_ns()) return;
  if (const DeviceTrouble trouble = port_->open()) {
    ++state_.counts.retries;
    state_.counts.last_error = trouble.error;
    retry_.failed(now_ns);
    return;
  }
  opened_ns_ = now_ns;
  state_.is_open = true;
  is_open_.store(true, std::memory_order_relaxed);
  next_heartbeat_ns_ = now_ns;
}

void MavlinkLink::lose(std::int64_t now_ns, int error) noexcept {
  port_->close();
  ++state_.counts.disconnected;
  state_.counts.last_error = error;
  state_.is_open = false;
  is_open_.store(false, std::memory_order_relaxed);
  frame_.size = frame_sent_ = 0;
  backlog_ = 0;
  // one that opens and fails at once is not tried in a hurry
  if (now_ns - opened_ns_ > kSecond_ns) retry_.begin(now_ns);
  retry_.failed(now_ns);
}

/// One piece at a time, so that what is to be sent never waits for a flood to end.
void MavlinkLink::read_port(std::int64_t now_ns) noexcept {
  if (input_.available(now_ns) < 1) return;
  std::array<std::uint8_t, kReadAtOnce> piece;
  const PortResult result = port_->read(piece);
  if (result.is_lost) return lose(now_ns, result.error);
  ++state_.counts.pieces;
  input_.spend(kReadCost + static_cast<double>(result.bytes));
  std::span<const std::uint8_t> bytes(piece.data(), result.bytes);
  while (const Packet* const packet = parser_.next(bytes))
    if (is_authentic()) receive(*packet, now_ns);
}

/// Of the packet that was found last.
bool MavlinkLink::is_authentic() noexcept {
  if (!signing_) return true;
  using Verdict = Signing::Verdict;
  LinkCounts& counts = state_.counts;
  const Verdict verdict = signing_->check(parser_.raw(), signing_time_now());
  if (verdict == Verdict::kUnsigned) ++counts.unsigned_packets;
  if (verdict == Verdict::kWrong) ++counts.wrong_signatures;
  if (verdict == Verdict::kOld) ++counts.replayed_packets;
  return verdict == Verdict::kGood;
}

}  // namespace epiline::mavlink
