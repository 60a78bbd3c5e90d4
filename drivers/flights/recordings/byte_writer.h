#pragma once
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>

namespace epiline {

static_assert(std::endian::native == std::endian::little);

/// Appends little-endian numbers, and blocks preceded by their size.
class ByteWriter {
 public:
  template <class T>
  ByteWriter& number(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    return *this;
  }
  template <class Size>
  ByteWriter& block(std::string_view bytes) {
    return number(static_cast<Size>(bytes.size())).raw(bytes);
  }
  ByteWriter& raw(std::string_view bytes) {
    bytes_.append(bytes);
    return *this;
  }
  ByteWriter& text(std::string_view bytes) { return block<std::uint32_t>(bytes); }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

}  // namespace epiline
