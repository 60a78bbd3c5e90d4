#pragma once
// A file that is read at any place, and packed parts of it.
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace epiline {

using Bytes = std::vector<std::uint8_t>;

/// An open file. What claims to lie beyond its end is not there: no memory is taken for it.
class RandomFile {
 public:
  explicit RandomFile(const std::filesystem::path& path);
  ~RandomFile();
  RandomFile(const RandomFile&) = delete;
  RandomFile& operator=(const RandomFile&) = delete;

  /// As it was when the file was opened.
  std::uint64_t size() const { return size_; }
  bool holds(std::uint64_t offset, std::uint64_t bytes) const { return offset <= size_ && bytes <= size_ - offset; }
  /// False if and only if the file does not hold or give these bytes.
  bool read(std::uint64_t offset, std::uint64_t bytes, Bytes& out) const;

 private:
  int file_;
  std::uint64_t size_ = 0;
};

enum class Packing : std::uint8_t { kNone, kBz2, kLz4, kZstd, kUnknown };

inline constexpr std::uint64_t kUnknownSize = ~std::uint64_t{0};
/// Unpacks a whole stream. `size`: of the result, if known. Memory grows with what comes out. False if and only if the
/// stream is damaged, has another size or more than 1 GiB.
bool unpack(Packing packing, std::span<const std::uint8_t> packed, std::uint64_t size, Bytes& out);

bool is_zstd(std::span<const std::uint8_t> bytes);
/// Unpacks a file into another. Fails, with a reason, if and only if one cannot be read or written whole.
std::string unpack_zstd_file(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace epiline
