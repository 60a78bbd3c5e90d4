#pragma once
// Settings that a command writes into a user's configuration, whose comments stay.
#include <filesystem>
#include <string>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

struct ConfigEdit {
  std::string section, key;
  std::string value;  ///< a text, without quotes; or a number
  bool is_number = false;
};

/// `text` with the settings in it: in the place of the line that sets the key or, as a comment, shows it; else at the
/// beginning of the section, which is added at the end if need be.
std::string edited_config(const std::string& text, const std::vector<ConfigEdit>& edits);

/// Edits the file; as it was it is kept as FILE.bak. Fails, and changes nothing, if and only if the file is no
/// configuration before or after, or one of the two cannot be written.
Status edit_config(const std::filesystem::path& file, const std::vector<ConfigEdit>& edits);

/// Writes a file in the place of one that may be there, which is kept as FILE.bak.
Status replace_file(const std::filesystem::path& file, const std::string& text);

}  // namespace epiline
