#pragma once
// Files for targets whose readers want a path.
#include <unistd.h>

#include <filesystem>
#include <string>
#include <system_error>

/// A folder of this process, in memory where there is some; it goes when the process ends in peace.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& name) : path_(root() / (name + "_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(path_);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  static std::filesystem::path root() {
    const std::filesystem::path memory = "/dev/shm";
    return std::filesystem::is_directory(memory) ? memory : std::filesystem::temp_directory_path();
  }

  std::filesystem::path path_;
};
