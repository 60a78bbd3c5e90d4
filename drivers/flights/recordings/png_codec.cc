#include <png.h>
#include <zlib.h>

#include <cstring>

#include "drivers/flights/recordings/image_codecs.h"

namespace epiline {

namespace {

// libpng reports an error by a jump out of its functions. A function that is jumped into holds no object with a
// destructor.
void give_up(png_structp png, png_const_charp /*message*/) { png_longjmp(png, 1); }
void keep_quiet(png_structp /*png*/, png_const_charp /*message*/) {}

struct Input {
  const std::uint8_t* next;
  std::size_t left;
};

void read_bytes(png_structp png, png_bytep out, png_size_t count) {
  auto& input = *static_cast<Input*>(png_get_io_ptr(png));
  if (count > input.left) png_error(png, "cut short");
  std::memcpy(out, input.next, count);
  input.next += count;
  input.left -= count;
}

void write_bytes(png_structp png, png_bytep bytes, png_size_t count) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(bytes), count);
}
void flush_nothing(png_structp /*png*/) {}

/// Everything becomes one value of grey for each pixel.
void ask_for_grey(png_structp png, png_infop info) {
  const int colour = png_get_color_type(png, info);
  png_set_strip_alpha(png);
  if (colour == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png);
  if ((colour & PNG_COLOR_MASK_COLOR) != 0) {
    png_set_strip_16(png);
    png_set_rgb_to_gray(png, PNG_ERROR_ACTION_NONE, 0.299, 0.587);
  } else {
    png_set_expand_gray_1_2_4_to_8(png);
  }
}

bool read_header(png_structp png, png_infop info, Input& input) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_user_limits(png, kLargestImage, kLargestImage);
  png_set_read_fn(png, &input, read_bytes);
  png_read_info(png, info);
  ask_for_grey(png, info);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  const int bits = png_get_bit_depth(png, info);
  return png_get_channels(png, info) == 1 && (bits == 8 || bits == 16);
}

bool read_rows(png_structp png, png_bytepp rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_read_image(png, rows);
  png_read_end(png, nullptr);
  return true;
}

bool write_rows(png_structp png, png_infop info, const GreyPixels& image, std::string& out) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_write_fn(png, &out, write_bytes, flush_nothing);
  png_set_compression_level(png, 1);
  png_set_compression_strategy(png, Z_HUFFMAN_ONLY);
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), 8,
               PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_BASE, PNG_FILTER_TYPE_BASE);
  png_write_info(png, info);
  for (int y = 0; y < image.height; ++y) png_write_row(png, image.row(y));
  png_write_end(png, info);
  return true;
}

}  // namespace

bool decode_png(const std::uint8_t* bytes, std::size_t size, GreyImage& image) {
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, give_up, keep_quiet);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  Input input{bytes, size};
  bool done = info != nullptr && read_header(png, info, input);
  if (done) {
    image.resize(static_cast<int>(png_get_image_width(png, info)), static_cast<int>(png_get_image_height(png, info)));
    const bool wide = png_get_bit_depth(png, info) == 16;
    std::vector<std::uint8_t> words(wide ? 2 * image.pixels.size() : 0);
    std::vector<png_bytep> rows;
    for (int y = 0; y < image.height; ++y)
      rows.push_back(wide ? words.data() + 2 * (image.row(y) - image.row(0)) : image.row(y));
    done = read_rows(png, rows.data());
    for (std::size_t i = 0; wide && i < image.pixels.size(); ++i)
      image.pixels[i] = image.grey_of(unsigned{words[2 * i]} << 8 | words[2 * i + 1]);
  }
  png_destroy_read_struct(&png, &info, nullptr);
  return done;
}

std::string png_of(const GreyPixels& image) {
  std::string out;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, give_up, keep_quiet);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  if (info == nullptr || !write_rows(png, info, image, out)) out.clear();
  png_destroy_write_struct(&png, &info);
  return out;
}

}  // namespace epiline
