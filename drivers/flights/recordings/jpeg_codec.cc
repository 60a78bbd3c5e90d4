#include <csetjmp>
#include <cstdio>  // before jpeglib.h, which needs FILE
#include <cstdlib>

#include <jpeglib.h>

#include <jerror.h>

#include "drivers/flights/recordings/image_codecs.h"

namespace epiline {

namespace {

// libjpeg reports an error by a call that must not return. A function that is jumped into holds no object with a
// destructor.
struct Errors {
  jpeg_error_mgr manager;  // first: libjpeg knows only this part
  std::jmp_buf back;
  bool cut_short = false;
};

void give_up(j_common_ptr codec) { std::longjmp(reinterpret_cast<Errors*>(codec->err)->back, 1); }

/// What is missing of an image is filled with grey, with a warning. An image must be whole.
void take_warning(j_common_ptr codec, int /*level*/) {
  const int code = codec->err->msg_code;
  if (code == JWRN_JPEG_EOF || code == JWRN_HIT_MARKER) reinterpret_cast<Errors*>(codec->err)->cut_short = true;
}

jpeg_error_mgr* set_up(Errors& errors) {
  jpeg_std_error(&errors.manager);
  errors.manager.error_exit = give_up;
  errors.manager.emit_message = take_warning;
  return &errors.manager;
}

bool read_header(jpeg_decompress_struct& codec, Errors& errors, const std::uint8_t* bytes, std::size_t size) {
  if (setjmp(errors.back) != 0) return false;
  jpeg_create_decompress(&codec);
  jpeg_mem_src(&codec, bytes, size);
  if (jpeg_read_header(&codec, TRUE) != JPEG_HEADER_OK) return false;
  codec.out_color_space = JCS_GRAYSCALE;
  return codec.image_width <= kLargestImage && codec.image_height <= kLargestImage;
}

bool read_rows(jpeg_decompress_struct& codec, Errors& errors, GreyImage& image) {
  if (setjmp(errors.back) != 0) return false;
  jpeg_start_decompress(&codec);
  while (codec.output_scanline < codec.output_height) {
    JSAMPROW row = image.row(static_cast<int>(codec.output_scanline));
    jpeg_read_scanlines(&codec, &row, 1);
  }
  jpeg_finish_decompress(&codec);
  return !errors.cut_short;
}

bool write_rows(jpeg_compress_struct& codec, Errors& errors, const GreyPixels& image, int quality,
                unsigned char*& bytes, unsigned long& size) {
  if (setjmp(errors.back) != 0) return false;
  jpeg_create_compress(&codec);
  jpeg_mem_dest(&codec, &bytes, &size);
  codec.image_width = static_cast<JDIMENSION>(image.width);
  codec.image_height = static_cast<JDIMENSION>(image.height);
  codec.input_components = 1;
  codec.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&codec);
  jpeg_set_quality(&codec, quality, TRUE);
  jpeg_start_compress(&codec, TRUE);
  while (codec.next_scanline < codec.image_height) {
    auto* row = const_cast<JSAMPROW>(image.row(static_cast<int>(codec.next_scanline)));
    jpeg_write_scanlines(&codec, &row, 1);
  }
  jpeg_finish_compress(&codec);
  return true;
}

}  // namespace

bool decode_jpeg(const std::uint8_t* bytes, std::size_t size, GreyImage& image) {
  jpeg_decompress_struct codec{};
  Errors errors;
  codec.err = set_up(errors);
  bool done = read_header(codec, errors, bytes, size);
  if (done) {
    image.resize(static_cast<int>(codec.image_width), static_cast<int>(codec.image_height));
    done = read_rows(codec, errors, image);
  }
  jpeg_destroy_decompress(&codec);
  return done;
}

std::string jpeg_of(const GreyPixels& image, int quality) {
  jpeg_compress_struct codec{};
  Errors errors;
  codec.err = set_up(errors);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  std::string out;
  if (write_rows(codec, errors, image, quality, bytes, size)) out.assign(reinterpret_cast<char*>(bytes), size);
  jpeg_destroy_compress(&codec);
  std::free(bytes);
  return out;
}

}  // namespace epiline
