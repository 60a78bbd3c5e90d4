// Messages of a line and frames of a bus, as the controller model hears them: whatever comes, it judges and goes on.
// The first byte chooses.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/program/hil/controller_model.h"

namespace {

using namespace epiline;

constexpr HostStamp kBegin{5'000'000'000'000};

std::optional<hil::TruthState> standing(HostStamp /*stamp*/) { return hil::TruthState{}; }

/// Packets as the parser, which has a target of its own, would hand them on.
void hear_line(hil::ControllerModel& model, std::span<const std::uint8_t> bytes) {
  HostStamp now = kBegin;
  mavlink::Packet packet;
  while (bytes.size() > 3) {
    packet.id = mavlink::kMessages[bytes[0] % mavlink::kMessages.size()].id;
    packet.from.component = bytes[1] < 250 ? 197 : bytes[1];
    now = now + Span::from_milliseconds(bytes[1]);
    const std::size_t size = std::min<std::size_t>(bytes[2], bytes.size() - 3);
    packet.payload.fill(0);
    std::copy_n(bytes.begin() + 3, size, packet.payload.begin());
    bytes = bytes.subspan(3 + size);
    model.receive(packet, now);
    ++packet.sequence;
    while (model.next(now) != nullptr) {
    }
  }
}

void hear_bus(hil::ControllerModel& model, std::span<const std::uint8_t> bytes) {
  HostStamp now = kBegin;
  while (bytes.size() > 2) {
    can::Frame frame;
    frame.id = static_cast<std::uint16_t>(0x300 + bytes[0] % 12);
    frame.size = static_cast<std::uint8_t>(std::min<std::size_t>(bytes[1] % 65, bytes.size() - 2));
    std::copy_n(bytes.begin() + 2, frame.size, frame.data.begin());
    // a sound checksum, else nothing would come through
    if (frame.size > 1) frame.data[0] = can::crc_of(frame.id, {frame.data.data(), frame.size});
    bytes = bytes.subspan(2 + std::size_t{frame.size});
    now = now + Span::from_milliseconds(3);
    model.receive(frame, now);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  hil::ControllerSettings settings;
  settings.on_can = data[0] % 2 == 1;
  hil::ControllerModel model(settings, standing);
  const std::span<const std::uint8_t> bytes{data + 1, size - 1};
  if (settings.on_can) {
    hear_bus(model, bytes);
  } else {
    hear_line(model, bytes);
  }
  hil::text_of(model.finish(kBegin + Span::from_milliseconds(10'000)), kBegin);
  return 0;
}
