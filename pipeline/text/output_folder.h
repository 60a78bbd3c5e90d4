#pragma once
// The one rule of every command that writes: an earlier result of its own may be replaced, anything else may not.
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

/// What happens to files under the names of results that are no own earlier results.
enum class Foreign : std::uint8_t {
  kRefuse,
  kReplace,  ///< --force
  kKeep,     ///< NAME becomes NAME.1, or the next free number: a flight must not wait for an answer
};

/// The results of one command in a folder. A list of them lies beside, in `.epiline`, with the checksum of each: a
/// result that was edited since is no own one any more.
class OutputFolder {
 public:
  /// Call it before the work begins. `names`: what will be written inside the folder, files or whole folders. Fails if
  /// and only if the folder cannot be made or written, or something foreign is refused. It leaves no trace but renamed
  /// files.
  static Result<OutputFolder> claim(const std::filesystem::path& folder, const std::vector<std::string>& names,
                                    Foreign foreign);
  /// Lists what has been written.
  ~OutputFolder();
  OutputFolder(OutputFolder&&) noexcept = default;
  OutputFolder& operator=(OutputFolder&&) = delete;
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Files that were renamed, a remark for each.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  using Sums = std::map<std::string, std::string>;  ///< checksums by the name inside the folder; empty: cannot be read

  OutputFolder(std::filesystem::path folder, std::vector<std::string> names)
      : folder_(std::move(folder)), names_(std::move(names)) {}
  Sums sums() const;
  Sums listed() const;
  void list() const;

  std::filesystem::path folder_;
  std::vector<std::string> names_;  ///< empty: moved from
  std::vector<std::string> notes_;
  Sums foreign_;  ///< as they were at the beginning
};

/// `path` with the first number from 1 on behind it that is free.
std::filesystem::path numbered(const std::filesystem::path& path);

}  // namespace epiline
