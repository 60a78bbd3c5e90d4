#include "drivers/sensors/camera/jpeg_decoder.h"

#include <csetjmp>
#include <cstdio>  // before jpeglib.h, which needs FILE
#include <vector>

#include <jpeglib.h>

#include <jerror.h>

namespace epiline {

namespace {

constexpr std::size_t kAlignment = 64;        // libjpeg's SIMD reads and writes whole registers
constexpr std::size_t kTables = 64 << 10;     // what lasts from image to image: some 10 kB
constexpr std::size_t kWorking = 256 << 10;   // for one image, whatever its size
constexpr std::size_t kBytesPerColumn = 256;  // rows of three components that are worked on: some 60

constexpr std::size_t aligned(std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

/// Memory that is given out piece by piece, and taken back all at once.
class Arena {
 public:
  explicit Arena(std::size_t bytes) : memory_(bytes + kAlignment) {
    const auto at = reinterpret_cast<std::uintptr_t>(memory_.data());
    begin_ = aligned(at) - at;
    next_ = begin_;
  }
  /// Null: there is no more.
  void* take(std::size_t bytes) noexcept {
    const std::size_t room = memory_.size() - next_;
    if (bytes > room || aligned(bytes) > room) return nullptr;
    void* const piece = memory_.data() + next_;
    next_ += aligned(bytes);
    return piece;
  }
  void reset() noexcept { next_ = begin_; }

 private:
  std::vector<std::uint8_t> memory_;
  std::size_t begin_ = 0, next_ = 0;
};

}  // namespace

struct JpegDecoder::Codec {
  Codec(int w, int h)
      : width(static_cast<unsigned>(w)),
        height(static_cast<unsigned>(h)),
        working(kWorking + kBytesPerColumn * static_cast<std::size_t>(w)) {}

  jpeg_decompress_struct library{};
  jpeg_error_mgr errors{};
  std::jmp_buf back{};
  bool is_whole = true;
  unsigned width, height;
  Arena tables{kTables}, working;
};

namespace {

using Codec = JpegDecoder::Codec;

// What libjpeg calls. It reports an error by a call that must not return; a function that is jumped into holds no
// object with a destructor.

Codec& codec_of(j_common_ptr library) { return *static_cast<Codec*>(library->client_data); }

void give_up(j_common_ptr library) { std::longjmp(codec_of(library).back, 1); }

/// What is missing of an image is filled in, with a warning. Bytes between segments do no harm: some cameras pad.
void take_warning(j_common_ptr library, int /*level*/) {
  const int code = library->err->msg_code;
  if (code == JWRN_JPEG_EOF || code == JWRN_HIT_MARKER || code == JWRN_HUFF_BAD_CODE || code == JWRN_MUST_RESYNC)
    codec_of(library).is_whole = false;
}

void* take(j_common_ptr library, int pool, std::size_t bytes) {
  Codec& codec = codec_of(library);
  void* const piece = (pool == JPOOL_PERMANENT ? codec.tables : codec.working).take(bytes);
  if (piece == nullptr) give_up(library);
  return piece;
}

template <class Item>
Item** take_rows(j_common_ptr library, int pool, JDIMENSION items, JDIMENSION rows) {
  auto** const list = static_cast<Item**>(take(library, pool, rows * sizeof(Item*)));
  const std::size_t pitch = aligned(items * sizeof(Item));
  auto* row = static_cast<std::uint8_t*>(take(library, pool, rows * pitch));
  for (JDIMENSION i = 0; i < rows; ++i, row += pitch) list[i] = reinterpret_cast<Item*>(row);
  return list;
}

void take_back(j_common_ptr library, int pool) {
  if (pool == JPOOL_IMAGE) codec_of(library).working.reset();
}

bool make(Codec& codec) {
  codec.library.err = jpeg_std_error(&codec.errors);
  codec.errors.error_exit = give_up;
  codec.errors.emit_message = take_warning;
  codec.library.client_data = &codec;
  if (setjmp(codec.back) != 0) return false;
  jpeg_create_decompress(&codec.library);
  jpeg_memory_mgr& memory = *codec.library.mem;
  memory.alloc_small = take;
  memory.alloc_large = take;
  memory.alloc_sarray = take_rows<JSAMPLE>;
  memory.alloc_barray = take_rows<JBLOCK>;
  memory.free_pool = take_back;
  return true;
}

bool read(Codec& codec, const std::uint8_t* bytes, std::size_t size, std::uint8_t* to, int stride) {
  jpeg_decompress_struct& library = codec.library;
  codec.is_whole = true;
  if (setjmp(codec.back) != 0) return false;
  jpeg_mem_src(&library, bytes, size);
  if (jpeg_read_header(&library, TRUE) != JPEG_HEADER_OK) return false;
  // an image in several scans would need memory for all of it
  const bool is_baseline = library.progressive_mode == FALSE && jpeg_has_multiple_scans(&library) == FALSE;
  if (!is_baseline || library.image_width != codec.width || library.image_height != codec.height) return false;
  library.out_color_space = JCS_GRAYSCALE;
  jpeg_start_decompress(&library);
  while (library.output_scanline < library.output_height) {
    JSAMPROW row = to + static_cast<std::ptrdiff_t>(library.output_scanline) * stride;
    jpeg_read_scanlines(&library, &row, 1);
  }
  return codec.is_whole;
}

}  // namespace

JpegDecoder::JpegDecoder(int width, int height) : codec_(std::make_unique<Codec>(width, height)) {
  if (!make(*codec_)) codec_.reset();
}

JpegDecoder::~JpegDecoder() {
  if (codec_) jpeg_destroy_decompress(&codec_->library);
}

bool JpegDecoder::decode(const std::uint8_t* bytes, std::size_t size, std::uint8_t* to, int stride) noexcept {
  if (!codec_) return false;
  const bool is_read = read(*codec_, bytes, size, to, stride);
  jpeg_abort_decompress(&codec_->library);
  return is_read;
}

}  // namespace epiline
