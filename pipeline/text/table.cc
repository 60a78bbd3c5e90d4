#include "pipeline/text/table.h"

#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "pipeline/text/output_files.h"
#include "platform/linux/signals.h"

namespace epiline {

namespace {

std::string system_message(int error) { return error ? std::strerror(error) : "unknown reason"; }

std::string list(const std::vector<std::size_t>& widths) {
  std::string s;
  for (std::size_t i = 0; i < widths.size(); ++i) {
    if (i > 0) s += i + 1 == widths.size() ? " or " : ", ";
    s += std::to_string(widths[i]);
  }
  return s;
}

template <class T>
bool parse_whole(std::string_view field, T& value) {
  if (field.size() > 1 && field[0] == '+' && field[1] != '-') field.remove_prefix(1);
  const auto end = field.data() + field.size();
  const auto [stop, error] = std::from_chars(field.data(), end, value);
  return error == std::errc() && stop == end;
}

/// UTF-8 of a text that some editors of Windows write: UTF-16, by its mark at the beginning. Other texts as they are.
std::string as_utf8(std::string text) {
  const bool little = text.starts_with("\xff\xfe");
  if (!little && !text.starts_with("\xfe\xff")) return text;
  const auto unit = [&](std::size_t i) -> std::uint32_t {
    if (i + 1 >= text.size()) return 0xfffd;  // cut
    const auto first = static_cast<unsigned char>(text[i]), second = static_cast<unsigned char>(text[i + 1]);
    return little ? first | second << 8 : first << 8 | second;
  };
  std::string out;
  for (std::size_t i = 2; i < text.size(); i += 2) {
    std::uint32_t c = unit(i);
    if (c >> 10 == 0xd800 >> 10 && unit(i + 2) >> 10 == 0xdc00 >> 10) {
      c = 0x10000 + ((c & 0x3ff) << 10 | (unit(i + 2) & 0x3ff));
      i += 2;
    }
    const int more = c < 0x80 ? 0 : c < 0x800 ? 1 : c < 0x10000 ? 2 : 3;
    constexpr unsigned char kLead[] = {0, 0xc0, 0xe0, 0xf0};
    out += static_cast<char>(kLead[more] | c >> 6 * more);
    for (int k = more - 1; k >= 0; --k) out += static_cast<char>(0x80 | (c >> 6 * k & 0x3f));
  }
  return out;
}

}  // namespace

Result<std::string> read_text(const std::filesystem::path& path) {
  errno = 0;
  const gzFile file = gzopen(path.c_str(), "rb");
  if (!file) {
    return Error{ErrorKind::kUsage, path.string(), 0, "cannot be opened (" + system_message(errno) + ")",
                 "a readable file"};
  }
  gzbuffer(file, 1u << 16);
  std::string text;
  constexpr std::size_t kChunk = 1u << 16, kMost = std::size_t{1} << 31;  // a few bytes of gzip may unpack to anything
  int count = 0;
  do {
    const std::size_t size = text.size();
    if (size > kMost) {
      gzclose(file);
      return Error{ErrorKind::kUsage, path.string(), 0, "more than 2 GiB of text", "a flight of some hours at most"};
    }
    text.resize(size + kChunk);
    count = gzread(file, text.data() + size, kChunk);
    text.resize(size + static_cast<std::size_t>(std::max(count, 0)));
  } while (count > 0);
  int status = Z_OK;
  const std::string message = gzerror(file, &status);
  const int close_status = gzclose(file);
  if (count < 0 || status != Z_OK || close_status != Z_OK) {
    const std::string reason = status == Z_ERRNO ? system_message(errno) : "damaged or cut gzip stream";
    return Error{ErrorKind::kUsage, path.string(), 0, "cannot be read to its end (" + reason + ")", "a complete file"};
  }
  return as_utf8(std::move(text));
}

Status write_text(const std::filesystem::path& path, const std::string& text) {
  namespace fs = std::filesystem;
  std::error_code none;
  fs::path place = fs::canonical(path, none);  // a link stays a link
  if (none) place = path;
  struct stat old {};
  const bool exists = ::stat(place.c_str(), &old) == 0;
  const auto write = [&](const fs::path& to) {
    OutputFile file(to);
    file.append(text);
    return file.close() ? 0 : file.failure();
  };
  int error = 0;
  if (exists && !S_ISREG(old.st_mode)) {
    error = write(place);  // a terminal, a pipe
  } else {
    const SignalWait held({SIGINT, SIGTERM, SIGHUP});  // they would leave a file under a name for the time being
    const std::string made = place.string() + ".epiline-new";  // no name of a user's file
    error = write(made);
    if (error == 0 && exists) {  // a settings file stays readable for those for whom it was
      (void)!::chown(made.c_str(), old.st_uid, old.st_gid);
      (void)!::chmod(made.c_str(), old.st_mode & 07777);
    }
    if (error == 0 && std::rename(made.c_str(), place.c_str()) != 0) error = errno;
    if (error != 0) ::unlink(made.c_str());
    const fs::path folder = place.parent_path();
    if (error == 0) sync_folder(folder.empty() ? "." : folder);
  }
  if (error == 0) return Done{};
  return Error{ErrorKind::kUsage, path.string(), 0, "cannot be written (" + system_message(error) + ")",
               "a folder with room and permission"};
}

Status make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error) return Done{};
  return Error{ErrorKind::kUsage, folder.string(), 0, "cannot be made (" + error.message() + ")",
               "a folder for the results"};
}

std::filesystem::path find_table(const std::filesystem::path& folder, const std::string& name) {
  std::error_code ignored;
  for (const auto& candidate : {folder / name, folder / (name + ".gz")}) {
    if (std::filesystem::exists(candidate, ignored)) return candidate;
  }
  return {};
}

LineReader::LineReader(std::string_view text) : rest_(text) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (rest_.substr(0, kByteOrderMark.size()) == kByteOrderMark) rest_.remove_prefix(kByteOrderMark.size());
}

bool LineReader::next(std::string_view& line) {
  while (!rest_.empty()) {
    const std::size_t end = rest_.find('\n');
    line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    ++number_;
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string_view::npos || line[first] == '#') continue;
    line = line.substr(first, line.find_last_not_of(" \t\r") + 1 - first);
    return true;
  }
  return false;
}

bool take_field(std::string_view& line, std::string_view& field) {
  // A comma at the end of the line announces one more, empty, field; data() != nullptr keeps that apart from the end.
  if (line.data() == nullptr) return false;
  const auto blank = [](char c) { return c == ' ' || c == '\t'; };
  const auto separates = [](char c) { return c == ',' || c == ';'; };
  std::size_t begin = 0;
  while (begin < line.size() && blank(line[begin])) ++begin;
  std::size_t end = begin;
  while (end < line.size() && !separates(line[end]) && !blank(line[end])) ++end;
  field = line.substr(begin, end - begin);
  while (end < line.size() && blank(line[end])) ++end;
  if (end == line.size()) {
    line = {};
  } else {
    line.remove_prefix(separates(line[end]) ? end + 1 : end);
  }
  return true;
}

bool is_header(std::string_view line) {
  double value = 0;
  for (std::string_view field; take_field(line, field);)
    if (parse_number(field, value)) return false;
  return true;
}

bool parse_number(std::string_view field, double& value) { return parse_whole(field, value); }
bool parse_number(std::string_view field, std::int64_t& value) { return parse_whole(field, value); }

std::string quoted(std::string_view s) {
  constexpr std::size_t kLongest = 40;
  std::string q = "\"";
  for (const char c : s.substr(0, kLongest)) q += c >= ' ' && c < 127 ? c : '?';
  return q + (s.size() > kLongest ? "...\"" : "\"");
}

Result<NumberTable> parse_table(std::string_view text, const std::string& name, TimeColumn time,
                                const std::vector<std::size_t>& widths, const std::string& what) {
  const auto fail = [&](int line, std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, name, line, std::move(found), std::move(expected)};
  };
  NumberTable table;
  table.values.reserve(text.size() / 10);
  const bool of_sensor = time == TimeColumn::kSensor || time == TimeColumn::kImu;
  LineReader lines(text);
  TimeFields times;
  std::size_t width = 0;
  bool is_first = true;
  for (std::string_view line, field; lines.next(line); is_first = false) {
    if (is_first && time != TimeColumn::kNanoseconds && is_header(line)) continue;
    std::size_t count = 0;
    for (; take_field(line, field); ++count) {
      if (count == 0) {
        times.add(field, lines.number());
        continue;
      }
      double value = 0;
      if (!parse_number(field, value)) return fail(lines.number(), quoted(field), "a number");
      table.values.push_back(value);
    }
    if (width == 0 && std::find(widths.begin(), widths.end(), count) != widths.end()) width = count;
    if (count != width) {
      return fail(lines.number(), std::to_string(count) + (count == 1 ? " value" : " values"),
                  (width > 0 ? std::to_string(width) : list(widths)) + " in a line, one " + what);
    }
  }
  table.columns = width > 0 ? width - 1 : 0;
  auto ns = times.parse(time, name, table.notes);
  if (!ns) return ns.error();
  table.time_ns = std::move(*ns);
  if (of_sensor) table.sort(order_of_time(table.time_ns, name, table.notes));
  return table;
}

void NumberTable::sort(const std::vector<std::size_t>& order) {
  if (order.empty()) return;
  const NumberTable unsorted = *this;
  for (std::size_t i = 0; i < order.size(); ++i) {
    time_ns[i] = unsorted.time_ns[order[i]];
    std::copy_n(unsorted.row(order[i]), columns, values.begin() + static_cast<std::ptrdiff_t>(i * columns));
  }
}

}  // namespace epiline
