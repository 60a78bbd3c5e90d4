#include "drivers/program/check/bus_check.h"

#include <fmt/format.h>
#include <linux/can.h>

#include <string_view>

#include "drivers/links/can/messages.h"

namespace epiline {

namespace {

Finding bus_finding(Grade grade, const char* device, std::string text, std::string remedy = {}) {
  return {grade, device, std::move(text), std::move(remedy)};
}

}  // namespace

BusCheck::BusCheck(const DevicesConfig& config, Findings& out) : config_(config) {
  add("can", config.can.interface, out);
  add("wheel", config.wheel.interface, out);
}

void BusCheck::tell(Findings& out) {
  for (auto& [device, interface, listener] : listeners_) {
    const BusSignal& signal = config_.wheel.signal;
    const std::uint32_t wheel_id = signal.id | (signal.extended ? CAN_EFF_FLAG : 0);
    std::uint64_t frames = 0, ids = 0;
    bool has_wheel = false;
    for (const auto& [id, count] : listener->heard_so_far()) {
      has_wheel = has_wheel || id == wheel_id;
      if (is_ours(interface, id)) continue;
      frames += count;
      ++ids;
    }
    const std::string text = fmt::format("{} frames with {} identifiers received on {}", frames, ids, interface);
    const bool is_wheel = std::string_view(device) == "wheel";
    if (is_wheel && !has_wheel)
      out.push_back(
          bus_finding(Grade::kError, device, fmt::format("{}, none with 0x{:x} of wheel.signal", text, signal.id),
                      "switch the sender on; compare the bit rate and the identifier in wheel.signal with candump"));
    else if (frames == 0)
      out.push_back(
          bus_finding(Grade::kWarning, device, text,
                      "no other node sends; if one should, check bit rate, termination (120 Ohm at both ends) and "
                      "wires"));
    else
      out.push_back(bus_finding(Grade::kOk, device, text));
  }
}

void BusCheck::add(const char* device, const std::string& interface, Findings& out) {
  if (interface.empty() || has_error(out, device)) return;
  auto listener = std::make_unique<CanListener>();
  if (const Status opened = listener->open(interface); !opened)
    out.push_back(of_error(device, opened.error()));
  else
    listeners_.push_back({device, interface, std::move(listener)});
}

/// What this very check sends: the kernel lets all sockets of this computer hear it.
bool BusCheck::is_ours(const std::string& interface, std::uint32_t id) const {
  const CanConfig& can = config_.can;
  const auto first = static_cast<std::uint32_t>(can.base_id);
  return interface == can.interface && id >= first && id < first + can::kMessages.size();
}

}  // namespace epiline
