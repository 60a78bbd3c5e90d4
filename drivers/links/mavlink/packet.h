#pragma once
// Writes MAVLink 2 frames to a byte stream, and finds them in it, also among noise. Does not allocate, wait or throw.
// Page: docs/flight-controller.md.
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "drivers/links/mavlink/message.h"
#include "pipeline/config/devices.h"

namespace epiline::mavlink {

inline constexpr std::size_t kMaxPayload = 255;
inline constexpr std::size_t kSignature = 13;                                ///< link, time, hash
inline constexpr std::size_t kMaxFrame = 10 + kMaxPayload + 2 + kSignature;  ///< header, payload, checksum

struct Address {
  std::uint8_t system = 1;
  std::uint8_t component = 197;  ///< MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
  bool operator==(const Address&) const = default;
};

inline Address address_of(const MavlinkConfig& config) noexcept {
  return {static_cast<std::uint8_t>(config.system), static_cast<std::uint8_t>(config.component)};
}

/// The message is for us: it names us, or nobody.
template <class Message>
bool is_for(Address own, const Message& message) noexcept {
  return (message.target_system == 0 || message.target_system == own.system) &&
         (message.target_component == 0 || message.target_component == own.component);
}

inline constexpr std::uint16_t kSetMessageInterval = 511, kRequestMessage = 512;  ///< MAV_CMD
/// A command about the messages of a kind.
inline CommandLong command_about(std::uint32_t message, std::uint16_t command, Address to, float interval_us = 0) {
  CommandLong question;
  question.command = command;
  question.target_system = to.system;
  question.target_component = to.component;
  question.param1 = static_cast<float>(message);
  question.param2 = interval_us;
  return question;
}

/// What a frame carries.
struct Packet {
  std::uint32_t id = 0;
  Address from;
  std::uint8_t sequence = 0;
  std::array<std::uint8_t, kMaxPayload> payload{};  ///< zero beyond what was sent
};

template <class Message>
Packet pack(const Message& message, Address from, std::uint8_t sequence) noexcept {
  Packet packet{Message::kId, from, sequence, {}};
  std::size_t at = 0;
  for_each_field<Message>([&](const auto& f) {
    const auto& value = message.*f.member;
    std::memcpy(packet.payload.data() + at, &value, sizeof value);
    at += sizeof value;
  });
  return packet;
}

/// False, with the message as it was, if and only if the packet holds another one. Extensions that were not sent are 0.
template <class Message>
bool unpack(const Packet& packet, Message& message) noexcept {
  if (packet.id != Message::kId) return false;
  std::size_t at = 0;
  for_each_field<Message>([&](const auto& f) {
    auto& value = message.*f.member;
    std::memcpy(&value, packet.payload.data() + at, sizeof value);
    at += sizeof value;
  });
  return true;
}

struct FrameBytes {
  std::array<std::uint8_t, kMaxFrame> data;
  std::size_t size = 0;
  std::span<const std::uint8_t> bytes() const { return {data.data(), size}; }
};

/// The frame of a packet. `packet.id` is one of kMessages. With `will_be_signed`, its signature is still to be added.
FrameBytes frame_of(const Packet& packet, bool will_be_signed = false) noexcept;

/// A frame as it came, from its first byte to its last, the signature included.
struct RawFrame {
  std::span<const std::uint8_t> bytes;
  Address from;
  bool is_signed = false;
};

/// Finds the frames of kMessages in a byte stream. Accepts version 2, signed or not (Signing checks signatures), and
/// version 1, which flight controllers send until they receive version 2.
///
/// After bytes that look like a frame and are none, the search continues one byte later, so no valid frame is lost to
/// what precedes it.
class Parser {
 public:
  /// The next packet, valid until the next call; null if and only if `bytes` are used up. Removes what it reads from
  /// the front of `bytes`: call it until it returns null.
  const Packet* next(std::span<const std::uint8_t>& bytes) noexcept;

  /// Of the packet that next() returned, valid as long.
  RawFrame raw() const noexcept {
    return {{buffer_.data() + begin_ - raw_size_, raw_size_}, packet_.from, raw_is_signed_};
  }

  std::uint64_t packets() const noexcept { return packets_; }
  std::uint64_t bad_checksums() const noexcept { return bad_checksums_; }
  /// Bytes that belong to no returned packet, including frames of other messages.
  std::uint64_t skipped_bytes() const noexcept { return skipped_; }

 private:
  enum class Found { kPacket, kNothing, kPart };
  struct Shape {
    std::size_t header, payload, signature;
    const MessageInfo* message;
    std::size_t size() const { return header + payload + 2 + signature; }
  };

  Found look() noexcept;
  Found shape_of_front(Shape& shape) const noexcept;
  bool read(const Shape& shape) noexcept;

  std::array<std::uint8_t, 2 * kMaxFrame> buffer_{};
  std::size_t begin_ = 0, end_ = 0;  ///< what is in the buffer and not decided yet
  Packet packet_;
  std::size_t raw_size_ = 0;  ///< of the last packet's frame, which ends at begin_
  bool raw_is_signed_ = false;
  std::uint64_t packets_ = 0, bad_checksums_ = 0, skipped_ = 0;
};

}  // namespace epiline::mavlink
