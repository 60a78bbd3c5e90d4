// Any bytes as a MAVLink line, in pieces whose length is the first byte: never a crash; every byte is in a packet,
// skipped or waiting; what comes out comes back through a parser of its own; and a sound frame behind it all is found.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "drivers/links/mavlink/packet.h"

using namespace epiline::mavlink;

namespace {

void expect_to_come_back(const Packet& packet) {
  const FrameBytes frame = frame_of(packet);
  Parser parser;
  std::span<const std::uint8_t> bytes = frame.bytes();
  const Packet* const again = parser.next(bytes);
  if (!again || again->id != packet.id || again->sequence != packet.sequence) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::size_t piece = data[0] + 1U;
  Parser parser;
  for (std::size_t at = 1; at < size; at += piece) {
    std::span<const std::uint8_t> bytes(data + at, std::min(piece, size - at));
    while (const Packet* packet = parser.next(bytes)) expect_to_come_back(*packet);
  }
  if (parser.skipped_bytes() > size) std::abort();
  // what looks like a frame at the end of the data is decided before this one begins
  std::array<std::uint8_t, 2 * kMaxFrame> end{};
  const FrameBytes sound = frame_of(pack(Timesync{.tc1 = 1, .ts1 = 2}, Address{}, 42));
  std::copy(sound.bytes().begin(), sound.bytes().end(), end.begin() + kMaxFrame);
  std::span<const std::uint8_t> bytes(end);
  bool found = false;
  while (const Packet* packet = parser.next(bytes)) {
    Timesync message;
    found = found || (unpack(*packet, message) && packet->sequence == 42 && message.ts1 == 2);
  }
  return found ? 0 : (std::abort(), 1);
}
