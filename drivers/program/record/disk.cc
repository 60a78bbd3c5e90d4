#include "drivers/program/record/disk.h"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

namespace epiline {

namespace {

int make_file(const std::filesystem::path& path) noexcept {
  constexpr mode_t kMode = 0666;  // less the umask
  return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, kMode);
}

/// 0, or errno.
int write_all(Disk& disk, int fd, std::string_view bytes) noexcept {
  while (!bytes.empty()) {
    const ssize_t count = disk.write(fd, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return count < 0 ? errno : EIO;
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return 0;
}

}  // namespace

Disk& Disk::of_this_computer() noexcept {
  static Disk disk;
  return disk;
}

std::optional<std::uint64_t> Disk::free_bytes(const std::filesystem::path& folder) noexcept {
  struct statvfs all {};
  if (::statvfs(folder.c_str(), &all) != 0 || all.f_blocks == 0) return std::nullopt;
  return std::uint64_t{all.f_bavail} * all.f_frsize;
}

ssize_t Disk::write(int fd, const char* bytes, std::size_t count) noexcept { return ::write(fd, bytes, count); }

void Disk::remove(const std::filesystem::path& file) noexcept { ::unlink(file.c_str()); }

void Disk::sync(const std::filesystem::path& folder) noexcept {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  ::syncfs(fd);
  ::close(fd);
}

LineFile::LineFile(Disk& disk, const std::filesystem::path& path) : disk_(disk), fd_(make_file(path)) {
  if (fd_ < 0) failure_ = errno;
}

LineFile::~LineFile() {
  if (fd_ >= 0) ::close(fd_);
}

bool LineFile::append(std::string_view lines) noexcept {
  if (failure_ != 0) return false;
  failure_ = write_all(disk_, fd_, lines);
  if (failure_ == 0) {
    bytes_ += lines.size();
    return true;
  }
  (void)!::ftruncate(fd_, static_cast<off_t>(bytes_));
  return false;
}

void LineFile::sync() noexcept {
  if (fd_ >= 0 && ::fsync(fd_) != 0 && failure_ == 0) failure_ = errno;
}

int write_new_file(Disk& disk, const std::filesystem::path& path, std::string_view bytes) noexcept {
  const int fd = make_file(path);
  if (fd < 0) return errno;
  int error = write_all(disk, fd, bytes);
  if (::close(fd) != 0 && error == 0) error = errno;
  if (error != 0) disk.remove(path);
  return error;
}

Error cannot_be_written(const std::filesystem::path& path, int error) {
  return {ErrorKind::kRun, path.string(), 0, std::string("cannot be written (") + std::strerror(error) + ")",
          "a disk with room, and permission to write"};
}

}  // namespace epiline
