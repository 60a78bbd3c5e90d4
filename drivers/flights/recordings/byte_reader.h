#pragma once
// Little-endian numbers from the front of some bytes.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace epiline {

/// After the first value that is missing, all further ones are missing too.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  bool good() const { return good_; }
  std::size_t left() const { return bytes_.size() - at_; }
  std::size_t at() const { return at_; }
  void fail() { good_ = false; }

  std::span<const std::uint8_t> take(std::uint64_t size) {
    good_ = good_ && size <= left();
    if (!good_) return {};
    at_ += static_cast<std::size_t>(size);
    return bytes_.subspan(at_ - static_cast<std::size_t>(size), static_cast<std::size_t>(size));
  }
  template <class T>
  T number() {
    T value = 0;
    const auto bytes = take(sizeof(T));
    for (std::size_t i = 0; i < bytes.size(); ++i)
      value = static_cast<T>(value | static_cast<T>(static_cast<T>(bytes[i]) << (8 * i)));
    return value;
  }
  /// Bytes behind their length, a number of type T.
  template <class T>
  std::span<const std::uint8_t> block() {
    return take(number<T>());
  }
  std::string_view text() {
    const auto bytes = block<std::uint32_t>();
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool good_ = true;
};

}  // namespace epiline
