#include "pipeline/text/output_folder.h"

#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "pipeline/text/table.h"

namespace epiline {
namespace fs = std::filesystem;

namespace {

constexpr char kList[] = ".epiline";
constexpr std::string_view kListHeader =
    "# results of epiline in this folder (checksum, name): it replaces these, and nothing else, without being asked\n";

/// Checksum and size; empty if it is no file that can be read.
std::string sum_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<char, 1 << 16> bytes;
  uLong sum = crc32(0, nullptr, 0);
  std::uint64_t size = 0;
  while (in.read(bytes.data(), bytes.size()) || in.gcount() > 0) {
    sum = crc32(sum, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(in.gcount()));
    size += static_cast<std::uint64_t>(in.gcount());
  }
  return in.eof() ? std::to_string(sum) + "-" + std::to_string(size) : std::string();
}

/// Makes the folder, a file in it, and removes both again as far as they were not there.
Status try_folder(const fs::path& folder) {
  const auto refuse = [&](const std::string& found) {
    return Error{ErrorKind::kUsage, folder.string(), 0, found, "a folder for the results (--out)"};
  };
  std::error_code failed, ignored;
  if (fs::exists(folder, ignored) && !fs::is_directory(folder, ignored)) return refuse("is a file");
  std::vector<fs::path> made;
  for (fs::path path = folder; !path.empty() && !fs::exists(path, ignored) && path != path.parent_path();
       path = path.parent_path())
    made.push_back(path);
  fs::create_directories(folder, failed);
  std::string name = (folder / ".epiline-XXXXXX").string();
  const int file = failed ? -1 : ::mkstemp(name.data());
  const int fault = failed ? failed.value() : errno;
  if (file >= 0) {
    ::close(file);
    ::unlink(name.c_str());
  }
  for (const fs::path& path : made) fs::remove(path, ignored);
  return file >= 0 ? Status(Done{}) : refuse(std::string("cannot be written (") + std::strerror(fault) + ")");
}

bool is_within(const std::string& file, const std::string& name) {
  return file == name || (file.size() > name.size() && file[name.size()] == '/' && file.starts_with(name));
}

}  // namespace

fs::path numbered(const fs::path& path) {
  std::error_code ignored;
  for (int n = 1;; ++n) {
    fs::path name = path.string() + "." + std::to_string(n);
    if (fs::symlink_status(name, ignored).type() == fs::file_type::not_found) return name;
  }
}

Result<OutputFolder> OutputFolder::claim(const fs::path& folder, const std::vector<std::string>& names,
                                         Foreign foreign) {
  OutputFolder claimed(folder, {});
  if (const Status s = try_folder(claimed.folder_); !s) return s.error();
  claimed.names_ = names;
  const Sums own = claimed.listed();
  for (const auto& [name, sum] : claimed.sums()) {
    const auto found = own.find(name);
    if (!sum.empty() && found != own.end() && found->second == sum) continue;
    const fs::path path = claimed.folder_ / name;
    if (foreign == Foreign::kRefuse) {
      claimed.names_.clear();
      return Error{ErrorKind::kUsage, path.string(), 0, "is no earlier result of this program, or was changed since",
                   "another place (--out), or --force to replace it"};
    }
    if (foreign == Foreign::kReplace) {
      claimed.foreign_[name] = sum;
      continue;
    }
    const fs::path kept = numbered(path);
    std::error_code failed;
    fs::rename(path, kept, failed);
    claimed.notes_.push_back(failed ? path.string() + " could not be kept: " + failed.message()
                                    : path.string() + " was there: kept as " + kept.string());
  }
  return claimed;
}

OutputFolder::~OutputFolder() {
  try {
    if (!names_.empty()) list();
  } catch (const std::exception&) {  // without the list, the results count as foreign next time
  }
}

OutputFolder::Sums OutputFolder::sums() const {
  Sums sums;
  std::error_code ignored;
  for (const std::string& name : names_) {
    const fs::path path = folder_ / name;
    const auto type = fs::symlink_status(path, ignored).type();
    if (type == fs::file_type::not_found) continue;
    if (type != fs::file_type::directory) {
      sums[name] = sum_of(path);
      continue;
    }
    for (auto at = fs::recursive_directory_iterator(path, ignored); at != fs::recursive_directory_iterator();
         at.increment(ignored))
      if (fs::symlink_status(at->path(), ignored).type() != fs::file_type::directory)
        sums[at->path().lexically_relative(folder_).string()] = sum_of(at->path());
  }
  return sums;
}

OutputFolder::Sums OutputFolder::listed() const {
  Sums sums;
  std::ifstream in(folder_ / kList);
  for (std::string line; std::getline(in, line);) {
    const std::size_t space = line.find(' ');
    if (space != std::string::npos && line[0] != '#') sums[line.substr(space + 1)] = line.substr(0, space);
  }
  return sums;
}

void OutputFolder::list() const {
  const Sums before = listed();
  Sums own = sums();
  std::erase_if(own, [&](const auto& file) {
    const auto was = foreign_.find(file.first);
    return file.second.empty() || (was != foreign_.end() && was->second == file.second);
  });
  for (const auto& was : before)
    if (std::none_of(names_.begin(), names_.end(), [&](const std::string& name) { return is_within(was.first, name); }))
      own.insert_or_assign(was.first, was.second);
  if (own == before) return;
  std::string text(kListHeader);
  for (const auto& [file, sum] : own) text.append(sum).append(" ").append(file).append("\n");
  (void)write_text(folder_ / kList, text);
}

}  // namespace epiline
