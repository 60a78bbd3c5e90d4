#include "drivers/flights/recordings/random_file.h"

#include <bzlib.h>
#include <fcntl.h>
#include <lz4frame.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <memory>

namespace epiline {

namespace {

constexpr std::uint64_t kLargestPart = std::uint64_t{1} << 30;

/// Gives a decoder room until it has ended: twice as much each time, never more than the result may have. `step`
/// decodes into the room given, and returns what it wrote; `done` is set at the end of the stream, `failed` where it is
/// damaged.
struct Decoded {
  std::size_t written = 0;
  bool done = false, failed = false;
};
template <class Step>
bool grow(std::size_t packed, std::uint64_t most, Bytes& out, Step step) {
  constexpr std::uint64_t kUsualRatio = 4, kLeast = 1 << 16;
  out.resize(static_cast<std::size_t>(std::min(most, std::max(kLeast, kUsualRatio * packed))));
  for (std::size_t filled = 0;;) {
    const Decoded p = step(out.data() + filled, out.size() - filled);
    filled += p.written;
    if (p.failed) return false;
    if (p.done) {
      out.resize(filled);
      return true;
    }
    if (filled < out.size() && p.written == 0) return false;  // the stream ends before its end
    if (filled < out.size()) continue;
    if (out.size() == most) {  // one more byte would be too many; the end may still be to come
      std::uint8_t beyond = 0;
      const Decoded last = step(&beyond, 0);
      return last.done && !last.failed;
    }
    out.resize(static_cast<std::size_t>(std::min<std::uint64_t>(most, 2 * std::uint64_t{out.size()})));
  }
}

bool unpack_bz2(std::span<const std::uint8_t> packed, std::uint64_t most, Bytes& out) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return false;
  stream.next_in = reinterpret_cast<char*>(const_cast<std::uint8_t*>(packed.data()));
  stream.avail_in = static_cast<unsigned>(packed.size());
  const bool good = grow(packed.size(), most, out, [&](std::uint8_t* to, std::size_t room) {
    stream.next_out = reinterpret_cast<char*>(to);
    stream.avail_out = static_cast<unsigned>(room);
    const int result = BZ2_bzDecompress(&stream);
    return Decoded{room - stream.avail_out, result == BZ_STREAM_END, result != BZ_OK && result != BZ_STREAM_END};
  });
  BZ2_bzDecompressEnd(&stream);
  return good;
}

bool unpack_lz4(std::span<const std::uint8_t> packed, std::uint64_t most, Bytes& out) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) return false;
  const bool good = grow(packed.size(), most, out, [&](std::uint8_t* to, std::size_t room) {
    std::size_t written = room, taken = packed.size();
    const std::size_t result = LZ4F_decompress(context, to, &written, packed.data(), &taken, nullptr);
    packed = packed.subspan(taken);
    return Decoded{written, result == 0, LZ4F_isError(result) != 0};
  });
  LZ4F_freeDecompressionContext(context);
  return good;
}

/// What a frame asks for, 128 MB at most, is touched only as far as something comes out.
bool unpack_zstd(std::span<const std::uint8_t> packed, std::uint64_t most, Bytes& out) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), &ZSTD_freeDCtx);
  ZSTD_inBuffer take{packed.data(), packed.size(), 0};
  return grow(packed.size(), most, out, [&](std::uint8_t* to, std::size_t room) {
    ZSTD_outBuffer give{to, room, 0};
    std::size_t left = 0;  // of a frame; another one may follow
    do left = ZSTD_decompressStream(context.get(), &give, &take);
    while (left == 0 && take.pos < take.size && give.pos < give.size);
    return Decoded{give.pos, left == 0 && take.pos == take.size, ZSTD_isError(left) != 0};
  });
}

}  // namespace

RandomFile::RandomFile(const std::filesystem::path& path) : file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  struct stat status {};
  if (file_ >= 0 && fstat(file_, &status) == 0 && S_ISREG(status.st_mode))
    size_ = static_cast<std::uint64_t>(status.st_size);
}

RandomFile::~RandomFile() {
  if (file_ >= 0) ::close(file_);
}

bool RandomFile::read(std::uint64_t offset, std::uint64_t bytes, Bytes& out) const {
  if (!holds(offset, bytes)) return false;
  out.resize(static_cast<std::size_t>(bytes));
  for (std::size_t done = 0; done < out.size();) {
    const ssize_t got = pread(file_, out.data() + done, out.size() - done, static_cast<off_t>(offset + done));
    if (got <= 0) return false;
    done += static_cast<std::size_t>(got);
  }
  return true;
}

bool unpack(Packing packing, std::span<const std::uint8_t> packed, std::uint64_t size, Bytes& out) {
  const std::uint64_t most = std::min(size, kLargestPart);
  if (size != kUnknownSize && size > kLargestPart) return false;
  bool good = false;
  if (packing == Packing::kBz2) good = unpack_bz2(packed, most, out);
  if (packing == Packing::kLz4) good = unpack_lz4(packed, most, out);
  if (packing == Packing::kZstd) good = unpack_zstd(packed, most, out);
  return good && (size == kUnknownSize || out.size() == size);
}

bool is_zstd(std::span<const std::uint8_t> bytes) {
  constexpr std::uint8_t kZstdMagic[] = {0x28, 0xb5, 0x2f, 0xfd};
  return bytes.size() >= sizeof kZstdMagic && std::equal(std::begin(kZstdMagic), std::end(kZstdMagic), bytes.begin());
}

std::string unpack_zstd_file(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::ifstream in(from, std::ios::binary);
  std::ofstream out(to, std::ios::binary);
  if (!out) return to.string() + " cannot be written";
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), &ZSTD_freeDCtx);
  std::vector<char> packed(ZSTD_DStreamInSize()), plain(ZSTD_DStreamOutSize());
  std::size_t left = 1;
  while (in.read(packed.data(), static_cast<std::streamsize>(packed.size())) || in.gcount() > 0) {
    ZSTD_inBuffer take{packed.data(), static_cast<std::size_t>(in.gcount()), 0};
    for (bool is_full = false; take.pos < take.size || is_full;) {
      ZSTD_outBuffer give{plain.data(), plain.size(), 0};
      left = ZSTD_decompressStream(context.get(), &give, &take);
      if (ZSTD_isError(left) != 0) return "cannot be unpacked (" + std::string(ZSTD_getErrorName(left)) + ")";
      out.write(plain.data(), static_cast<std::streamsize>(give.pos));
      is_full = give.pos == give.size;
    }
  }
  out.flush();
  if (!out) return to.string() + " cannot be written: no room to unpack it?";
  return left == 0 ? "" : "ends in the middle of its packed data";
}

}  // namespace epiline
