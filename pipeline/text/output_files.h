#pragma once
// Files and folders that are there whole or not at all, also after the power was cut.
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

/// A folder in the making: everything goes to `NAME.partial`, which finish() renames to `NAME`, replacing an older one.
/// Without finish() nothing is left behind.
class PartialFolder {
 public:
  /// Makes the folder and `parts` inside. Fails if and only if one cannot be made.
  static Result<PartialFolder> create(const std::filesystem::path& name, const std::vector<std::string>& parts);
  ~PartialFolder();
  PartialFolder(PartialFolder&& other) noexcept : name_(std::move(other.name_)) { other.name_.clear(); }
  PartialFolder& operator=(PartialFolder&&) = delete;
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  std::filesystem::path root() const { return name_.string() + ".partial"; }
  /// Fails if and only if an older folder of that name cannot be replaced.
  Status finish();

 private:
  explicit PartialFolder(std::filesystem::path name) : name_(std::move(name)) {}
  std::filesystem::path name_;
};

/// A file that is written in pieces. It keeps the first error and returns it at the end.
class OutputFile {
 public:
  explicit OutputFile(std::filesystem::path path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void append(std::string_view text) noexcept;
  /// Flushes: other programs can read everything appended so far.
  void flush() noexcept;
  /// errno of the first failure; 0: none so far.
  int failure() const { return failure_; }
  /// Closes the file once it is on the disk. Fails if and only if anything of it could not be written.
  Status close();

 private:
  std::filesystem::path path_;
  std::FILE* file_;
  int failure_ = 0;
};

/// Waits until the folder's list of files is on the disk.
void sync_folder(const std::filesystem::path& folder);

}  // namespace epiline
