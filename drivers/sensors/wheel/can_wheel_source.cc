#include "drivers/sensors/wheel/can_wheel_source.h"

#include <linux/can.h>
#include <linux/errqueue.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

#include "platform/linux/system_calls.h"
#include "platform/time/monotonic.h"
#include "platform/time/sleep.h"

namespace epiline {

namespace {

/// What the kernel says beside a frame.
struct Side {
  ArrivalStamps stamps;
  std::uint32_t overruns = 0;  ///< since the socket was opened
};
Side side_of(msghdr& header) noexcept {
  Side side;
  const auto ns = [](const timespec& t) { return t.tv_sec * 1'000'000'000LL + t.tv_nsec; };
  for (cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr; c = CMSG_NXTHDR(&header, c)) {
    if (c->cmsg_level != SOL_SOCKET) continue;
    if (c->cmsg_type == SCM_TIMESTAMPING && c->cmsg_len >= CMSG_LEN(sizeof(scm_timestamping))) {
      scm_timestamping stamps;
      std::memcpy(&stamps, CMSG_DATA(c), sizeof stamps);
      side.stamps = {ns(stamps.ts[0]), ns(stamps.ts[2])};
    } else if (c->cmsg_type == SO_RXQ_OVFL && c->cmsg_len >= CMSG_LEN(sizeof side.overruns)) {
      std::memcpy(&side.overruns, CMSG_DATA(c), sizeof side.overruns);
    }
  }
  return side;
}

}  // namespace

bool GapWatch::is_after_gap(HostStamp stamp) noexcept {
  constexpr int kEnough = 10;
  const double interval_s = (stamp - last_).seconds();
  const bool known = seen_ > kEnough, gap = known && interval_s > 3 * usual_s_;
  // one long interval must not become the usual one; many in a row do
  if (seen_ > 0) usual_s_ += (std::min(interval_s, known ? 4 * usual_s_ : interval_s) - usual_s_) / std::min(seen_, 20);
  last_ = stamp;
  if (seen_ <= kEnough + 20) ++seen_;
  return gap;
}

CanWheelSource::CanWheelSource(WheelConfig config) : config_(std::move(config)) {}

Status CanWheelSource::check_settings() const {
  const auto error = [](const char* found, const char* expected) {
    return Error{ErrorKind::kUsage, "[wheel]", 0, found, expected};
  };
  if (config_.interface.empty()) return error("interface is not set", "wheel.interface, as `ip -br link` shows it");
  if (config_.signal.length == 0) return error("signal is not set", kBusSignalForm);
  return Done{};
}

Status CanWheelSource::open() {
  if (const Status settings = check_settings(); !settings) return settings;
  if (const DeviceTrouble trouble = open_socket()) return error_of(trouble, config_.interface);
  opened_ = true;
  return Done{};
}

DeviceTrouble CanWheelSource::open_socket() noexcept {
  gap_watch_.forget();
  overruns_seen_ = 0;
  return socket_.open_to_receive(config_.interface.c_str(), config_.signal.id, config_.signal.extended);
}

void CanWheelSource::close() noexcept {
  socket_.close();
  opened_ = false;
}

void CanWheelSource::lose(int error) noexcept {
  ++counts_.disconnected;
  counts_.last_error = error;
  socket_.close();
  retry_.begin(monotonic_ns());
  retry_.failed(monotonic_ns());
}

/// Waits for the next attempt as long as there is time. False: still lost.
bool CanWheelSource::reopen(std::int64_t until_ns) noexcept {
  sleep_until(std::min(retry_.due_ns(), until_ns));
  if (monotonic_ns() < retry_.due_ns()) return false;
  const DeviceTrouble trouble = open_socket();
  if (!trouble) return true;
  ++counts_.retries;
  counts_.last_error = trouble.error;
  retry_.failed(monotonic_ns());
  return false;
}

bool CanWheelSource::wait(std::int64_t until_ns) noexcept {
  pollfd ready{socket_.fd(), POLLIN, 0};
  return SystemCalls::of_this_computer().wait({&ready, 1}, Span{until_ns - monotonic_ns()}) > 0;
}

ReadOutcome CanWheelSource::read(WheelSample& sample, Span timeout) noexcept {
  if (!opened_) return ReadOutcome::kFailed;
  const ReadOutcome outcome = read_until(monotonic_ns() + timeout.ns, sample);
  shown_counts_.write(counts_);
  return outcome;
}

ReadOutcome CanWheelSource::read_until(std::int64_t until_ns, WheelSample& sample) noexcept {
  if (!socket_.is_open() && !reopen(until_ns)) return ReadOutcome::kFailed;
  do {  // frames of no use are left out as long as there is time
    const ReadOutcome outcome = take(sample);
    if (outcome != ReadOutcome::kTimeout) return outcome;
  } while (wait(until_ns) && monotonic_ns() <= until_ns);
  return ReadOutcome::kTimeout;
}

ReadOutcome CanWheelSource::take(WheelSample& sample) noexcept {
  canfd_frame frame{};
  alignas(cmsghdr) char side_data[CMSG_SPACE(sizeof(scm_timestamping)) + CMSG_SPACE(sizeof(std::uint32_t))];
  iovec buffer{&frame, sizeof frame};
  msghdr header{};
  header.msg_iov = &buffer;
  header.msg_iovlen = 1;
  header.msg_control = side_data;
  header.msg_controllen = sizeof side_data;
  const ssize_t size = ::recvmsg(socket_.fd(), &header, MSG_DONTWAIT);
  if (size < 0) {
    if (errno == EAGAIN || errno == EINTR) return ReadOutcome::kTimeout;
    lose(errno);
    return ReadOutcome::kFailed;
  }
  const Side side = side_of(header);
  counts_.overruns += side.overruns - overruns_seen_;
  overruns_seen_ = side.overruns;
  return decode({reinterpret_cast<const std::uint8_t*>(&frame), static_cast<std::size_t>(size)}, side.stamps, sample)
             ? ReadOutcome::kSample
             : ReadOutcome::kTimeout;
}

bool CanWheelSource::decode(std::span<const std::uint8_t> frame, const ArrivalStamps& stamps,
                            WheelSample& sample) noexcept {
  const bool is_sample = take_signal(frame, stamps, sample);
  shown_counts_.write(counts_);
  return is_sample;
}

bool CanWheelSource::take_signal(std::span<const std::uint8_t> bytes, const ArrivalStamps& stamps,
                                 WheelSample& sample) noexcept {
  canfd_frame frame{};
  if (bytes.size() != CAN_MTU && bytes.size() != CANFD_MTU) {
    ++counts_.too_short;
    return false;
  }
  std::memcpy(&frame, bytes.data(), bytes.size());
  const std::uint32_t wanted = config_.signal.id | (config_.signal.extended ? CAN_EFF_FLAG : 0);
  if (frame.can_id != wanted) return false;  // the kernel's filter lets none through
  const std::size_t room = bytes.size() - offsetof(canfd_frame, data), size = std::min<std::size_t>(frame.len, room);
  const auto value = value_of(config_.signal, {frame.data, size});
  if (!value) {
    ++(size < static_cast<std::size_t>(bytes_of(config_.signal)) ? counts_.too_short : counts_.not_finite);
    return false;
  }
  const HostStamp arrival = clock_.arrival(stamps, ClockPair::now());
  sample.stamp = arrival - Span::from_seconds(1e-3 * config_.delay_ms);
  sample.forward_speed_m_s = *value;
  sample.yaw_rate_rad_s = std::numeric_limits<double>::quiet_NaN();
  counts_.bad_stamps = clock_.bad_stamps();
  counts_.gaps += gap_watch_.is_after_gap(sample.stamp) ? 1 : 0;
  ++counts_.samples;
  return true;
}

}  // namespace epiline
