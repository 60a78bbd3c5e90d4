#include "drivers/flights/recordings/image_codecs.h"

#include <bit>
#include <cstring>

namespace epiline {

namespace {

/// Numbers in the header of a PGM: between blanks, and lines of remarks.
class HeaderReader {
 public:
  HeaderReader(const std::uint8_t* bytes, std::size_t size) : next_(bytes), end_(bytes + size) {}

  /// -1: none, or too large.
  int number() {
    skip_blanks();
    if (next_ == end_ || !is_digit(*next_)) return -1;
    int value = 0;
    for (; next_ != end_ && is_digit(*next_) && value >= 0; ++next_)
      value = value < 1'000'000 ? 10 * value + (*next_ - '0') : -1;
    return value;
  }
  /// The one blank between the header and the pixels.
  const std::uint8_t* pixels() const { return next_ == end_ ? end_ : next_ + 1; }

 private:
  static bool is_digit(std::uint8_t c) { return c >= '0' && c <= '9'; }
  void skip_blanks() {
    bool remark = false;
    for (; next_ != end_ && (remark || *next_ == '#' || *next_ == ' ' || (*next_ >= '\t' && *next_ <= '\r')); ++next_)
      remark = *next_ == '#' || (remark && *next_ != '\n');
  }
  const std::uint8_t *next_, *end_;
};

bool begins_with(const std::uint8_t* bytes, std::size_t size, const char* magic) {
  const std::size_t length = std::strlen(magic);
  return size >= length && std::memcmp(bytes, magic, length) == 0;
}

}  // namespace

bool decode_pgm(const std::uint8_t* bytes, std::size_t size, GreyImage& image) {
  if (!begins_with(bytes, size, "P5")) return false;
  HeaderReader header(bytes + 2, size - 2);
  const int width = header.number(), height = header.number(), most = header.number();
  if (width < 1 || height < 1 || width > kLargestImage || height > kLargestImage || most < 1 || most > 65535)
    return false;
  const std::size_t each = most > 255 ? 2 : 1,
                    count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const std::uint8_t* const pixels = header.pixels();
  if (static_cast<std::size_t>(bytes + size - pixels) < each * count) return false;
  image.resize(width, height);
  // of two bytes the upper one comes first
  if (each == 2) image.used_bits = std::bit_width(static_cast<unsigned>(most));
  for (std::size_t i = 0; i < count; ++i)
    image.pixels[i] = each == 1 ? pixels[i] : image.grey_of(unsigned{pixels[2 * i]} << 8 | pixels[2 * i + 1]);
  return true;
}

bool decode_image(const std::uint8_t* bytes, std::size_t size, GreyImage& image) {
  image.highest = 0;
  if (begins_with(bytes, size, "\x89PNG")) return decode_png(bytes, size, image);
  if (begins_with(bytes, size, "\xff\xd8")) return decode_jpeg(bytes, size, image);
  return decode_pgm(bytes, size, image);
}

}  // namespace epiline
