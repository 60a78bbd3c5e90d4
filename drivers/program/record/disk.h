#pragma once
// Files of a recording that are readable whenever the program is ended, and the disk below them.
#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "platform/error/result.h"

namespace epiline {

/// The disk under a recording. Tests bring one that is full or slow.
class Disk {
 public:
  virtual ~Disk() = default;
  static Disk& of_this_computer() noexcept;

  /// Bytes that this user can still write there; nothing if the file system does not say.
  virtual std::optional<std::uint64_t> free_bytes(const std::filesystem::path& folder) noexcept;
  /// write(2).
  virtual ssize_t write(int fd, const char* bytes, std::size_t count) noexcept;
};

/// A new file to which whole lines are appended. The kernel has them when append() returns, so they outlive the
/// program; what it got of lines that it could not take whole is cut off again.
class LineFile {
 public:
  LineFile(Disk& disk, const std::filesystem::path& path);
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;

  /// False: failure() says why not. Nothing is appended after a failure.
  bool append(std::string_view lines) noexcept;
  /// errno of the first failure, which opening can be; 0: none so far.
  int failure() const { return failure_; }
  std::uint64_t bytes() const { return bytes_; }
  /// Waits until the file is on the disk.
  void sync() noexcept;

 private:
  Disk& disk_;
  int fd_, failure_ = 0;
  std::uint64_t bytes_ = 0;
};

/// Writes a new file: whole or not at all. 0, or errno.
int write_new_file(Disk& disk, const std::filesystem::path& path, std::string_view bytes) noexcept;

/// The failure of a file as an error.
Error cannot_be_written(const std::filesystem::path& path, int error);

}  // namespace epiline
