#include "drivers/flights/recordings/bag_reader.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <string_view>
#include <utility>

namespace epiline {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kRos1 = "#ROSBAG V2.0\n", kOldRos1 = "#ROSBAG V", kMcap = "\x89MCAP0\r\n",
                           kSqlite = std::string_view("SQLite format 3\0", 16);

std::string first_bytes(const fs::path& path) {
  std::array<char, 16> bytes{};
  std::ifstream in(path, std::ios::binary);
  in.read(bytes.data(), bytes.size());
  return {bytes.data(), static_cast<std::size_t>(in.gcount())};
}

bool is_packed(const std::string& first) {
  return is_zstd({reinterpret_cast<const std::uint8_t*>(first.data()), first.size()});
}

Error no_bag(const fs::path& path, std::string found) {
  return {ErrorKind::kUsage, path.string(), 0, "cannot be read as a bag (" + std::move(found) + ")",
          "a ROS 1 bag (format 2.0), an MCAP file, or a ROS 2 bag"};
}

/// A bag that was packed as a whole. Its unpacked file lies among the temporary ones as long as it is read.
class UnpackedFile final : public BagReader {
 public:
  static Result<std::unique_ptr<BagReader>> open(const fs::path& path) {
    std::string name = (fs::temp_directory_path() / "epiline-bag-XXXXXX").string();
    const int file = ::mkstemp(name.data());
    if (file < 0) return no_bag(path, "no room to unpack it in " + fs::temp_directory_path().string());
    ::close(file);
    std::unique_ptr<UnpackedFile> made(new UnpackedFile(name));
    if (const std::string reason = unpack_zstd_file(path, name); !reason.empty()) return no_bag(path, reason);
    if (is_packed(first_bytes(name))) return no_bag(path, "packed twice");
    auto inner = open_bag_reader(name);
    if (!inner) return no_bag(path, inner.error().found);
    made->inner_ = std::move(*inner);
    return std::unique_ptr<BagReader>(std::move(made));
  }
  ~UnpackedFile() override {
    std::error_code ignored;
    inner_.reset();
    fs::remove(file_, ignored);
  }
  Status scan(const See& see) override {
    const auto adopt = [&] {
      if (topics_.size() < inner_->topics().size()) topics_ = inner_->topics();
    };
    Status scanned = inner_->scan([&](const BagMessage& message) {
      adopt();
      see(message);
    });
    adopt();
    note_ = inner_->note();
    return scanned;
  }
  Result<std::span<const std::uint8_t>> read(const BagPlace& place) override { return inner_->read(place); }

 private:
  explicit UnpackedFile(fs::path file) : file_(std::move(file)) {}
  fs::path file_;
  std::unique_ptr<BagReader> inner_;
};

}  // namespace

std::size_t BagReader::add_topic(BagTopic topic) {
  if (const std::size_t at = topic.type.find("/msg/"); at != std::string::npos) topic.type.erase(at, 4);
  return number_of(topic, topics_);
}

std::size_t number_of(const BagTopic& topic, std::vector<BagTopic>& topics) {
  const auto found = std::find(topics.begin(), topics.end(), topic);
  const auto number = static_cast<std::size_t>(found - topics.begin());
  if (found == topics.end()) topics.push_back(topic);
  return number;
}

Error RecordFile::damaged(std::uint64_t offset, const std::string& what) const {
  return no_bag(path_, what + " at byte " + std::to_string(offset));
}

Status RecordFile::ends_early(std::uint64_t offset) {
  note_ = path_.string() + ": ends early, as after an interruption: read up to byte " + std::to_string(offset) +
          " of " + std::to_string(file_.size());
  return Done{};
}

Result<std::span<const std::uint8_t>> RecordFile::open_chunk(const Chunk& chunk) {
  chunks_.push_back(chunk);
  return unpack_chunk(chunks());
}

Result<std::span<const std::uint8_t>> RecordFile::unpack_chunk(std::uint32_t number) {
  const Chunk& chunk = chunks_[number - 1];
  if (open_ != number) {
    open_ = 0;
    Bytes& bytes = chunk.packing == Packing::kNone ? unpacked_ : packed_;
    const bool good = file_.read(chunk.offset, chunk.size, bytes) &&
                      (chunk.packing == Packing::kNone || unpack(chunk.packing, packed_, chunk.unpacked, unpacked_));
    if (!good) return damaged(chunk.offset, "a chunk that cannot be unpacked");
    open_ = number;
  }
  return std::span<const std::uint8_t>(unpacked_);
}

Result<std::span<const std::uint8_t>> RecordFile::read(const BagPlace& place) {
  if (place.chunk > 0) {
    const auto bytes = unpack_chunk(place.chunk);
    if (!bytes) return bytes.error();
    if (place.offset > bytes->size() || place.size > bytes->size() - place.offset)
      return damaged(place.offset, "a chunk that has changed");
    return bytes->subspan(static_cast<std::size_t>(place.offset), static_cast<std::size_t>(place.size));
  }
  if (!file_.read(place.offset, place.size, message_)) return damaged(place.offset, "a message that cannot be read");
  return std::span<const std::uint8_t>(message_);
}

bool looks_like_bag(const fs::path& path) {
  const std::string first = first_bytes(path);
  return first.starts_with(kOldRos1) || first.starts_with(kMcap) || first == kSqlite || is_packed(first);
}

Result<std::unique_ptr<BagReader>> open_bag_reader(const fs::path& path) {
  const std::string first = first_bytes(path);
  if (first.starts_with(kRos1)) return ros1_bag_reader(path);
  if (first.starts_with(kMcap)) return mcap_reader(path);
  if (first == kSqlite) return db3_reader(path);
  if (is_packed(first)) return UnpackedFile::open(path);
  if (first.starts_with(kOldRos1)) return no_bag(path, "an older format, " + first.substr(1, first.find('\n') - 1));
  return no_bag(path, first.empty() ? "it is empty" : "unknown first bytes");
}

}  // namespace epiline
