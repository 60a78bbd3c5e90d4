// Any bytes as a MAVLink line, in pieces whose length is the first byte: never a crash; every byte is in a packet,
// skipped or waiting; what comes out comes back through a parser of its own; and a sound frame behind it all is found.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "drivers/links/mavlink/packet.h"
#include "drivers/links/mavlink/signing.h"

using namespace epiline::mavlink;

namespace {

void expect_to_come_back(const Packet& packet) {
  const FrameBytes frame = frame_of(packet);
  Parser parser;
  std::span<const std::uint8_t> bytes = frame.bytes();
  const Packet* const again = parser.next(bytes);
  if (!again || again->id != packet.id || again->sequence != packet.sequence) std::abort();
}

/// Bytes that were made without the key are never good, whatever they claim; a frame of a key's holder is, once.
void expect_no_forgery(const std::uint8_t* data, std::size_t size) {
  if (!can_sign()) return;
  const SigningKey key{1, 2, 3};
  Signing receiver(key), sender(key);
  Parser parser;
  const auto look = [&](std::span<const std::uint8_t> bytes, bool is_ours) {
    for (int good = 0; const Packet* packet = parser.next(bytes);) {
      const RawFrame raw = parser.raw();
      if (raw.bytes.size() > kMaxFrame || raw.from.system != packet->from.system) std::abort();
      if (receiver.check(raw, 0) == Signing::Verdict::kGood && (!is_ours || ++good > 1)) std::abort();
    }
  };
  look({data, size}, false);
  parser = {};
  FrameBytes frame = frame_of(pack(Timesync{.tc1 = 1, .ts1 = 2}, Address{}, 42), true);
  sender.sign(frame, 77);
  std::array<std::uint8_t, 2 * kMaxFrame> twice{};
  std::copy_n(frame.data.begin(), frame.size, twice.begin());
  std::copy_n(frame.data.begin(), frame.size, twice.begin() + static_cast<std::ptrdiff_t>(frame.size));
  look({twice.data(), 2 * frame.size}, true);
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
  expect_no_forgery(data + 1, size - 1);
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
