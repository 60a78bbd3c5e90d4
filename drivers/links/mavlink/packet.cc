#include "drivers/links/mavlink/packet.h"

#include <algorithm>

#include "platform/error/contract.h"

namespace epiline::mavlink {

namespace {

constexpr std::uint8_t kMagic = 0xfd, kMagicV1 = 0xfe;
constexpr std::size_t kHeader = 10, kHeaderV1 = 6;
constexpr std::uint8_t kSigned = 1;  // of the flags that a reader must understand

const MessageInfo* info_of(std::uint32_t id) noexcept {
  const auto* const found =
      std::find_if(kMessages.begin(), kMessages.end(), [&](const MessageInfo& m) { return m.id == id; });
  return found == kMessages.end() ? nullptr : found;
}

/// Of all but the magic.
std::uint16_t checksum(std::span<const std::uint8_t> bytes, std::uint8_t extra) noexcept {
  std::uint16_t crc = 0xffff;
  for (const std::uint8_t byte : bytes) crc = crc_add(crc, byte);
  return crc_add(crc, extra);
}

}  // namespace

FrameBytes frame_of(const Packet& packet, bool will_be_signed) noexcept {
  const MessageInfo* const known = info_of(packet.id);
  EPILINE_EXPECTS(known != nullptr, "a packet to send is one of kMessages");
  const MessageInfo& message = *known;
  std::size_t length = message.length;
  while (length > 1 && packet.payload[length - 1] == 0) --length;  // zeros at the end do not travel
  FrameBytes frame;
  const auto byte = [&](std::size_t value) { frame.data[frame.size++] = static_cast<std::uint8_t>(value); };
  for (const std::size_t value :
       {std::size_t{kMagic}, length, std::size_t{will_be_signed ? kSigned : 0U}, std::size_t{0}})
    byte(value);
  for (const std::uint8_t value : {packet.sequence, packet.from.system, packet.from.component}) byte(value);
  for (const int shift : {0, 8, 16}) byte((packet.id >> shift) & 0xff);
  std::copy_n(packet.payload.begin(), length, frame.data.begin() + kHeader);
  frame.size += length;
  const std::uint16_t crc = checksum(frame.bytes().subspan(1), message.crc_extra);
  byte(crc & 0xffU);
  byte(crc >> 8U);
  return frame;
}

/// Whether a frame may begin at the front, and how long it would be.
Parser::Found Parser::shape_of_front(Shape& shape) const noexcept {
  const std::uint8_t* const b = buffer_.data() + begin_;
  const std::size_t available = end_ - begin_;
  const bool v1 = b[0] == kMagicV1;
  if (b[0] != kMagic && !v1) return Found::kNothing;
  if (available < (v1 ? kHeaderV1 : kHeader)) return Found::kPart;
  if (v1) {
    shape = {kHeaderV1, b[1], 0, info_of(b[5])};
    return shape.message && shape.message->base_length == shape.payload ? Found::kPacket : Found::kNothing;
  }
  const std::uint32_t id = b[7] | std::uint32_t{b[8]} << 8U | std::uint32_t{b[9]} << 16U;
  shape = {kHeader, b[1], (b[2] & kSigned) != 0 ? kSignature : 0, info_of(id)};
  return shape.message && shape.payload > 0 && (b[2] & ~kSigned) == 0 ? Found::kPacket : Found::kNothing;
}

/// Takes the frame at the front into packet_. False: its checksum is wrong.
bool Parser::read(const Shape& shape) noexcept {
  const std::uint8_t* const b = buffer_.data() + begin_;
  const std::size_t end = shape.header + shape.payload;
  const std::uint16_t crc = checksum({b + 1, end - 1}, shape.message->crc_extra);
  if (b[end] != (crc & 0xff) || b[end + 1] != crc >> 8) return false;
  const std::size_t address = shape.header == kHeader ? 4 : 2;
  packet_.id = shape.message->id;
  packet_.sequence = b[address];
  packet_.from = {b[address + 1], b[address + 2]};
  packet_.payload.fill(0);
  std::copy_n(b + shape.header, shape.payload, packet_.payload.begin());
  return true;
}

/// Decides as much of the buffer as can be decided.
Parser::Found Parser::look() noexcept {
  for (; begin_ < end_; ++begin_, ++skipped_) {
    Shape shape{};
    const Found found = shape_of_front(shape);
    if (found == Found::kPart) return Found::kPart;
    if (found == Found::kNothing) continue;
    if (end_ - begin_ < shape.size()) return Found::kPart;
    if (read(shape)) {
      begin_ += shape.size();
      raw_size_ = shape.size();
      raw_is_signed_ = shape.signature != 0;
      ++packets_;
      return Found::kPacket;
    }
    ++bad_checksums_;
  }
  return Found::kNothing;
}

const Packet* Parser::next(std::span<const std::uint8_t>& bytes) noexcept {
  while (true) {
    if (look() == Found::kPacket) return &packet_;
    if (bytes.empty()) return nullptr;
    // less than a frame is undecided: there is room for another
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
              buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
    end_ -= begin_;
    begin_ = 0;
    const std::size_t count = std::min(bytes.size(), buffer_.size() - end_);
    std::copy_n(bytes.begin(), count, buffer_.begin() + static_cast<std::ptrdiff_t>(end_));
    end_ += count;
    bytes = bytes.subspan(count);
  }
}

}  // namespace epiline::mavlink
