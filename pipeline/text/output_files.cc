#include "pipeline/text/output_files.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

namespace epiline {
namespace fs = std::filesystem;

Result<PartialFolder> PartialFolder::create(const fs::path& name, const std::vector<std::string>& parts) {
  PartialFolder made(name);
  std::error_code failed;
  fs::remove_all(made.root(), failed);
  const auto make = [&](const fs::path& path) { return fs::create_directories(path, failed) || !failed; };
  fs::path path = made.root();
  bool good = make(path);
  for (const std::string& part : parts) good = good && make(path = made.root() / part);
  if (!good) return Error{ErrorKind::kUsage, path.string(), 0, failed.message(), "a folder to write to"};
  return made;
}

PartialFolder::~PartialFolder() {
  std::error_code ignored;
  if (!name_.empty()) fs::remove_all(root(), ignored);
}

Status PartialFolder::finish() {
  std::error_code failed;
  fs::remove_all(name_, failed);
  if (!failed) fs::rename(root(), name_, failed);
  if (failed) return Error{ErrorKind::kUsage, name_.string(), 0, failed.message(), "a folder to replace"};
  return Done{};
}

OutputFile::OutputFile(fs::path path) : path_(std::move(path)), file_(std::fopen(path_.c_str(), "wbe")) {
  if (file_ == nullptr) failure_ = errno;
}

OutputFile::~OutputFile() {
  if (file_ != nullptr) std::fclose(file_);
}

void OutputFile::append(std::string_view text) noexcept {
  if (failure_ != 0 || text.empty()) return;
  errno = 0;
  if (std::fwrite(text.data(), 1, text.size(), file_) != text.size()) failure_ = errno != 0 ? errno : EIO;
}

void OutputFile::flush() noexcept {
  if (failure_ == 0 && std::fflush(file_) != 0) failure_ = errno;
}

Status OutputFile::close() {
  if (file_ != nullptr) {
    // what is no file on a disk refuses to be synced
    const bool flushed = std::fflush(file_) == 0 && (fsync(fileno(file_)) == 0 || errno == EINVAL || errno == ENOTSUP);
    if (!flushed && failure_ == 0) failure_ = errno;
    if (std::fclose(file_) != 0 && failure_ == 0) failure_ = errno;
    file_ = nullptr;
  }
  if (failure_ == 0) return Done{};
  return Error{ErrorKind::kUsage, path_.string(), 0, "cannot be written (" + std::string(std::strerror(failure_)) + ")",
               "a folder with room and permission"};
}

void sync_folder(const fs::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  fsync(descriptor);
  ::close(descriptor);
}

}  // namespace epiline
