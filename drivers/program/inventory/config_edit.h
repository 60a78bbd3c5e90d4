#pragma once
// Writes settings into a user's configuration and keeps its comments.
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

enum class EditKind : std::uint8_t { kText, kNumber, kUnset };

struct ConfigEdit {
  std::string section, key;
  std::string value;  ///< a text, without quotes; or a number
  EditKind kind = EditKind::kText;
};

/// Returns `text` with the settings. Each replaces the line that sets its key, or the comment that shows it; otherwise
/// it is inserted at the beginning of its section. A missing section is appended. kUnset makes a comment of the line
/// that sets the key.
std::string edited_config(const std::string& text, const std::vector<ConfigEdit>& edits);

/// Edits the file and keeps the previous version as replace_file() does; returns its name. Fails, and changes nothing,
/// if and only if the file is not a valid configuration before or after, or one of the two files cannot be written.
Result<std::filesystem::path> edit_config(const std::filesystem::path& file, const std::vector<ConfigEdit>& edits);

/// Writes a file. An existing one is kept as FILE.bak, or FILE.bak.1 and so on: no earlier version is lost. Returns the
/// name of what was kept, empty if there was no file.
Result<std::filesystem::path> replace_file(const std::filesystem::path& file, const std::string& text);

}  // namespace epiline
