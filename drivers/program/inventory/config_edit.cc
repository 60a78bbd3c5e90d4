#include "drivers/program/inventory/config_edit.h"

#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

#include "pipeline/config/config.h"
#include "pipeline/text/output_folder.h"
#include "pipeline/text/table.h"

namespace epiline {

namespace {

std::string_view trimmed(std::string_view text) {
  const auto begin = text.find_first_not_of(" \t\r"), end = text.find_last_not_of(" \t\r");
  return begin == std::string_view::npos ? std::string_view() : text.substr(begin, end - begin + 1);
}

std::optional<std::string_view> section_of(std::string_view line) {
  line = trimmed(line.substr(0, line.find('#')));
  if (line.size() < 2 || line.front() != '[' || line.back() != ']') return std::nullopt;
  return trimmed(line.substr(1, line.size() - 2));
}

enum class Mention { kNone, kComment, kSetting };

Mention mention_of(std::string_view line, std::string_view key) {
  line = trimmed(line);
  const bool is_comment = line.starts_with('#');
  if (is_comment) line = trimmed(line.substr(1));
  if (!line.starts_with(key) || !trimmed(line.substr(key.size())).starts_with('=')) return Mention::kNone;
  return is_comment ? Mention::kComment : Mention::kSetting;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

void edit(std::vector<std::string>& lines, const ConfigEdit& e) {
  const std::string line = e.key + " = " + (e.kind == EditKind::kText ? toml_text(e.value) : e.value);
  std::size_t header = lines.size(), place = lines.size();
  Mention mention = Mention::kNone;
  std::string section;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (const auto name = section_of(lines[i])) {
      section = *name;
      if (section == e.section && header == lines.size()) header = i;
    } else if (section == e.section && mention_of(lines[i], e.key) > mention) {
      mention = mention_of(lines[i], e.key);
      place = i;
    }
  }
  if (e.kind == EditKind::kUnset) {
    if (mention == Mention::kSetting) lines[place].insert(0, "# ");
  } else if (mention != Mention::kNone) {
    lines[place] = line;
  } else if (header < lines.size()) {
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(header) + 1, line);
  } else {
    lines.insert(lines.end(), {"", "[" + e.section + "]", line});
  }
}

}  // namespace

std::string edited_config(const std::string& text, const std::vector<ConfigEdit>& edits) {
  std::vector<std::string> lines = lines_of(text);
  for (const ConfigEdit& e : edits) edit(lines, e);
  std::string edited;
  for (const std::string& line : lines) edited += line + '\n';
  return edited;
}

Result<std::filesystem::path> edit_config(const std::filesystem::path& file, const std::vector<ConfigEdit>& edits) {
  const auto text = read_text(file);
  if (!text) return text.error();
  if (const auto before = ConfigFile::parse(*text, file.string()); !before) return before.error();
  const std::string edited = edited_config(*text, edits);
  if (const auto after = ConfigFile::parse(edited, file.string()); !after) return after.error();
  return replace_file(file, edited);
}

Result<std::filesystem::path> replace_file(const std::filesystem::path& file, const std::string& text) {
  std::error_code failed;
  std::filesystem::path kept;
  if (std::filesystem::exists(file, failed)) {
    const auto old = read_text(file);
    if (!old) return old.error();
    kept = file.string() + ".bak";
    if (std::filesystem::exists(kept, failed)) kept = numbered(kept);
    if (const Status s = write_text(kept, *old); !s) return s.error();
  }
  if (const Status s = write_text(file, text); !s) return s.error();
  return kept;
}

}  // namespace epiline
