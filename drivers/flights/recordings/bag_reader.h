#pragma once
// One file of a bag, whatever its format: the messages in it.
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/flights/recordings/random_file.h"
#include "platform/error/result.h"

namespace epiline {

struct BagTopic {
  std::string name;
  std::string type;      ///< as ROS 1 writes it: sensor_msgs/Image
  std::string encoding;  ///< of the messages: ros1, cdr
  bool operator==(const BagTopic&) const = default;
};

/// Of a topic among others, behind which it is added if need be.
std::size_t number_of(const BagTopic& topic, std::vector<BagTopic>& topics);

/// Where a message is, for its reader.
struct BagPlace {
  std::uint32_t file = 0;   ///< of a bag of several
  std::uint32_t chunk = 0;  ///< counted from 1; 0: the message is not packed
  std::uint64_t offset = 0, size = 0;
};

struct BagMessage {
  std::size_t topic = 0;
  std::int64_t recorded_ns = 0;
  std::span<const std::uint8_t> bytes;  ///< until the next message
  BagPlace place;
};

class BagReader {
 public:
  using See = std::function<void(const BagMessage&)>;

  BagReader() = default;
  virtual ~BagReader() = default;
  BagReader(const BagReader&) = delete;
  BagReader& operator=(const BagReader&) = delete;

  /// Shows every message once, in the file's order; an index is not needed. A file that ends early is read up to that
  /// place, which note() then tells. Fails if the file is damaged before its end.
  virtual Status scan(const See& see) = 0;
  /// One message again; valid until the next call. Fails if and only if it cannot be read any more.
  virtual Result<std::span<const std::uint8_t>> read(const BagPlace& place) = 0;

  /// Those found so far.
  const std::vector<BagTopic>& topics() const { return topics_; }
  /// A remark for the user; empty: none.
  const std::string& note() const { return note_; }

 protected:
  /// Its number; a topic that is known keeps its own.
  std::size_t add_topic(BagTopic topic);

  std::vector<BagTopic> topics_;
  std::string note_;
};

/// A file of records and of chunks with packed records.
class RecordFile : public BagReader {
 public:
  explicit RecordFile(const std::filesystem::path& path) : path_(path), file_(path) {}
  Result<std::span<const std::uint8_t>> read(const BagPlace& place) override;

 protected:
  struct Chunk {
    std::uint64_t offset, size, unpacked;
    Packing packing;
  };
  /// The records of a chunk; remembers where it is.
  Result<std::span<const std::uint8_t>> open_chunk(const Chunk& chunk);
  std::uint32_t chunks() const { return static_cast<std::uint32_t>(chunks_.size()); }
  const RandomFile& file() const { return file_; }
  Error damaged(std::uint64_t offset, const std::string& what) const;
  /// Ends a scan where the file was cut within a record; note() then tells it.
  Status ends_early(std::uint64_t offset);

 private:
  Result<std::span<const std::uint8_t>> unpack_chunk(std::uint32_t number);

  std::filesystem::path path_;
  RandomFile file_;
  std::vector<Chunk> chunks_;
  std::uint32_t open_ = 0;  ///< chunk in unpacked_; 0: none
  Bytes packed_, unpacked_, message_;
};

/// Opens a file by its first bytes. Fails if and only if it cannot be read, or is of none of these formats.
Result<std::unique_ptr<BagReader>> open_bag_reader(const std::filesystem::path& path);

std::unique_ptr<BagReader> ros1_bag_reader(const std::filesystem::path& path);
std::unique_ptr<BagReader> mcap_reader(const std::filesystem::path& path);
Result<std::unique_ptr<BagReader>> db3_reader(const std::filesystem::path& path);

/// The file begins like one that open_bag_reader() reads.
bool looks_like_bag(const std::filesystem::path& path);

}  // namespace epiline
