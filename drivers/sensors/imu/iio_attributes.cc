#include "drivers/sensors/imu/iio_attributes.h"

#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>

namespace epiline {

/// Not readdir(), which has a buffer on the heap.
int for_each_entry(const char* folder, bool (*use)(void* context, const char* name), void* context) noexcept {
  const int fd = ::open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return errno;
  alignas(std::uint64_t) std::array<char, 4096> entries;
  for (;;) {
    const long bytes = ::syscall(SYS_getdents64, fd, entries.data(), entries.size());
    if (bytes <= 0) {
      const int error = bytes < 0 ? errno : 0;
      ::close(fd);
      return error;
    }
    for (long at = 0; at < bytes;) {
      constexpr std::size_t kLengthAt = 16, kNameAt = 19;  // of struct linux_dirent64
      const char* const entry = entries.data() + at;
      std::uint16_t length = 0;
      std::memcpy(&length, entry + kLengthAt, sizeof(length));
      const char* const name = entry + kNameAt;
      if (std::strcmp(name, ".") != 0 && std::strcmp(name, "..") != 0 && !use(context, name)) {
        ::close(fd);
        return 0;
      }
      at += length;
    }
  }
}

void IioAttributes::set_folder(const char* folder) noexcept {
  std::snprintf(folder_.data.data(), folder_.data.size(), "%s", folder);
  changes_.clear();
}

int IioAttributes::open_file(const char* name, int flags) const noexcept {
  std::array<char, 320> path{};
  std::snprintf(path.data(), path.size(), "%s/%s", folder_.c_str(), name);
  return ::open(path.data(), flags | O_CLOEXEC);
}

int IioAttributes::read(const char* name, Text& value) const noexcept {
  value = {};
  const int fd = open_file(name, O_RDONLY);
  if (fd < 0) return errno;
  const ssize_t bytes = ::read(fd, value.data.data(), value.data.size() - 1);
  const int error = bytes < 0 ? errno : 0;
  ::close(fd);
  value.data[bytes < 0 ? 0 : static_cast<std::size_t>(bytes)] = '\0';
  value.data[std::strcspn(value.c_str(), "\n")] = '\0';
  return error;
}

int IioAttributes::read(const char* name, double& number) const noexcept {
  Text text;
  if (const int error = read(name, text); error != 0) return error;
  const char* const begin = text.c_str();
  const char* const end = begin + std::strlen(begin);
  const auto [stop, failed] = std::from_chars(begin, end, number);
  return failed == std::errc{} && stop == end && std::isfinite(number) ? 0 : EINVAL;
}

int IioAttributes::write_for_good(const char* name, const char* value) const noexcept {
  const int fd = open_file(name, O_WRONLY | O_TRUNC);
  if (fd < 0) return errno;
  const ssize_t bytes = ::write(fd, value, std::strlen(value));
  const int error = bytes < 0 ? errno : 0;
  ::close(fd);
  return error;
}

int IioAttributes::write(const char* name, const char* value) noexcept {
  Text before;
  const bool had_value = read(name, before) == 0 && !before.empty() && std::strcmp(before.c_str(), value) != 0;
  if (const int error = write_for_good(name, value); error != 0) return error;
  Change change;
  const auto size = [](const ShortText<64>& text) { return text.data.size(); };
  if (had_value && std::strlen(name) < size(change.name) && std::strlen(before.c_str()) < size(change.before)) {
    std::strcpy(change.name.data.data(), name);
    std::strcpy(change.before.data.data(), before.c_str());
    changes_.push_back(change);
  }
  return 0;
}

void IioAttributes::restore() noexcept {
  while (!changes_.empty()) {
    write_for_good(changes_.back().name.c_str(), changes_.back().before.c_str());
    changes_.resize(changes_.size() - 1);
  }
}

}  // namespace epiline
