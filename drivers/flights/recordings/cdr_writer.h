#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "drivers/flights/recordings/byte_writer.h"
#include "platform/time/clock.h"

namespace epiline {

/// A message of ROS 2 (CDR, little-endian): each number at a multiple of its size, counted behind the first four bytes;
/// texts end with a zero.
class CdrWriter {
 public:
  CdrWriter() { out_.number(std::uint32_t{0x00000100}); }

  template <class T>
  CdrWriter& number(T value) {
    while ((out_.bytes().size() - 4) % sizeof(T) != 0) out_.number(std::uint8_t{0});
    out_.number(value);
    return *this;
  }
  CdrWriter& u8(unsigned v) { return number(static_cast<std::uint8_t>(v)); }
  CdrWriter& u32(std::size_t v) { return number(static_cast<std::uint32_t>(v)); }
  CdrWriter& f64(double v) { return number(v); }
  CdrWriter& f64s(std::span<const double> values) {
    for (const double v : values) number(v);
    return *this;
  }
  CdrWriter& text(std::string_view text) {
    u32(text.size() + 1);
    out_.raw(text).number('\0');
    return *this;
  }
  /// A sequence of bytes.
  CdrWriter& block(std::string_view bytes) {
    u32(bytes.size());
    out_.raw(bytes);
    return *this;
  }
  CdrWriter& time(HostStamp stamp) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    const std::int64_t seconds = stamp.ns / kSecond - (stamp.ns % kSecond < 0 ? 1 : 0);
    number(static_cast<std::int32_t>(seconds));
    return u32(static_cast<std::size_t>(stamp.ns - seconds * kSecond));
  }
  /// std_msgs/Header
  CdrWriter& header(HostStamp stamp, std::string_view frame) { return time(stamp).text(frame); }
  const std::string& bytes() const { return out_.bytes(); }

 private:
  ByteWriter out_;
};

}  // namespace epiline
