#pragma once
// Files of a recording, which stay readable whenever the program ends, and the disk that they are on.
#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "platform/error/result.h"

namespace epiline {

/// The disk of a recording. Tests replace it by one that is full or slow.
class Disk {
 public:
  virtual ~Disk() = default;
  static Disk& of_this_computer() noexcept;

  /// Bytes that this user can still write to the file system of `folder`; none if it does not report them.
  virtual std::optional<std::uint64_t> free_bytes(const std::filesystem::path& folder) noexcept;
  /// As write(2).
  virtual ssize_t write(int fd, const char* bytes, std::size_t count) noexcept;
  /// As unlink(2): what did not fit whole gives its room to the lists.
  virtual void remove(const std::filesystem::path& file) noexcept;
  /// Waits until all that was written to the file system of `folder` is on the disk: one wait for many files.
  virtual void sync(const std::filesystem::path& folder) noexcept;
};

/// A new file to which whole lines are appended. The kernel holds the lines when append() returns, so they survive the
/// end of the program. If it takes a part of the lines only, the file is cut back to its previous length.
class LineFile {
 public:
  LineFile(Disk& disk, const std::filesystem::path& path);
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;

  /// False: the lines could not be appended; failure() holds the reason. Nothing is appended after a failure.
  bool append(std::string_view lines) noexcept;
  /// errno of the first failure, that of opening included; 0: none so far.
  int failure() const { return failure_; }
  std::uint64_t bytes() const { return bytes_; }
  /// Waits until the file is on the disk.
  void sync() noexcept;

 private:
  Disk& disk_;
  int fd_, failure_ = 0;
  std::uint64_t bytes_ = 0;
};

/// Writes a new file, whole or not at all. Returns 0 or errno.
int write_new_file(Disk& disk, const std::filesystem::path& path, std::string_view bytes) noexcept;

/// Describes the failure of a file as an error; `error`: errno.
Error cannot_be_written(const std::filesystem::path& path, int error);

}  // namespace epiline
