#include "drivers/program/check/bus_check.h"

#include <fmt/format.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>

#include "drivers/links/can/messages.h"

namespace epiline {

namespace {

constexpr int kWait_ms = 100;
constexpr int kFramesAtOnce = 256;  // then it looks whether it is to stop: a full bus must not hold it

}  // namespace

Status CanListener::open(const std::string& interface) {
  if (const DeviceTrouble trouble = socket_.open_to_listen(interface.c_str())) return error_of(trouble, interface);
  thread_.emplace([this] { return listen(); });
  return Done{};
}

bool CanListener::listen() {
  pollfd ready{socket_.fd(), POLLIN, 0};
  if (::poll(&ready, 1, kWait_ms) <= 0) return true;
  canfd_frame frame{};
  const std::lock_guard lock(mutex_);
  for (int i = 0; i < kFramesAtOnce; ++i) {
    // an interface that goes down is one error of read(); frames that come after it is up again are received
    const ssize_t size = ::recv(socket_.fd(), &frame, sizeof(frame), MSG_DONTWAIT);
    if (size < static_cast<ssize_t>(CAN_MTU)) return true;
    ++counts_[frame.can_id & (CAN_EFF_FLAG | CAN_EFF_MASK)];
  }
  return true;
}

CanListener::Counts CanListener::heard_so_far() {
  const std::lock_guard lock(mutex_);
  return counts_;
}

BusCheck::BusCheck(const DevicesConfig& config, Findings& out) : config_(config) {
  add("can", config.can.interface, out);
  add("wheel", config.wheel.interface, out);
}

void BusCheck::tell(Findings& out) {
  const BusSignal& signal = config_.wheel.signal;
  const std::uint32_t wheel_id = signal.id | (signal.extended ? CAN_EFF_FLAG : 0);
  for (const auto& [device, interface, listener] : buses_) {
    std::uint64_t frames = 0, ids = 0;
    bool has_wheel = false;
    for (const auto& [id, count] : listener->heard_so_far()) {
      has_wheel = has_wheel || id == wheel_id;
      if (is_ours(interface, id)) continue;
      frames += count;
      ++ids;
    }
    const bool lacks_wheel = device == "wheel" && !has_wheel;
    std::string text = fmt::format("{} frames with {} identifiers received on {}", frames, ids, interface);
    if (lacks_wheel) text += fmt::format(", none with 0x{:x} of wheel.signal", signal.id);
    DeviceFindings(device, out)
        .judge(text, {{lacks_wheel, Grade::kError,
                       "switch the sender on; compare the bit rate and the identifier in wheel.signal with candump"},
                      {frames == 0, Grade::kWarning,
                       "no other node sends; if one should, check bit rate, termination (120 Ohm at both ends) and "
                       "wires"}});
  }
}

void BusCheck::add(const char* device, const std::string& interface, Findings& out) {
  if (interface.empty() || has_error(out, device)) return;
  auto listener = std::make_unique<CanListener>();
  if (const Status opened = listener->open(interface); !opened)
    out.push_back(of_error(device, opened.error()));
  else
    buses_.push_back({device, interface, std::move(listener)});
}

/// What this very check sends: the kernel lets all sockets of this computer hear it.
bool BusCheck::is_ours(const std::string& interface, std::uint32_t id) const {
  const CanConfig& can = config_.can;
  const auto first = static_cast<std::uint32_t>(can.base_id);
  return interface == can.interface && id >= first && id < first + can::kMessages.size();
}

}  // namespace epiline
