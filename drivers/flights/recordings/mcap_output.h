#pragma once
// Writes an MCAP file of the profile `ros2`: chunks packed with zstd, an index behind each, and a summary with which a
// reader finds any time without reading the file. https://mcap.dev/spec
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

class McapOutput {
 public:
  /// Replaces the file, in a folder made if need be.
  explicit McapOutput(std::filesystem::path path);

  /// A topic of messages of the type (`sensor_msgs/msg/Imu`), encoded as cdr. `definition`: of the type and of those in
  /// it, as ROS 2 writes them (ros2msg). Returns its number.
  std::uint16_t add_channel(const std::string& topic, const std::string& type, std::string_view definition);
  void write(std::uint16_t channel, std::int64_t ns, std::string_view message);

  /// Fails if and only if the file could not be made, or not be written so far.
  Status status() const;
  /// Writes the summary, and returns the status of the whole file.
  Status finish();

 private:
  /// Where the messages of a chunk are.
  struct ChunkIndex {
    std::uint64_t first_ns = 0, last_ns = 0, start = 0, size = 0, index_size = 0, packed = 0, unpacked = 0;
    std::map<std::uint16_t, std::uint64_t> index_starts;  ///< by channel
  };
  struct Entry {
    std::uint64_t ns, offset;
  };
  struct Times {
    std::uint64_t first_ns = ~std::uint64_t{0}, last_ns = 0;
    void add(std::uint64_t ns) { first_ns = ns < first_ns ? ns : first_ns, last_ns = ns > last_ns ? ns : last_ns; }
  };

  void put(std::string_view bytes);
  void put_record(std::uint8_t op, std::string_view content);
  void flush();
  std::string statistics() const;

  std::filesystem::path path_;
  std::ofstream file_;
  std::uint64_t at_ = 0;
  std::uint32_t sum_ = 0;  ///< of all bytes since the start, or since that of the summary
  std::map<std::string, std::uint16_t> schemas_;
  std::string schema_records_, channel_records_, chunk_;
  std::map<std::uint16_t, std::uint64_t> counts_;        ///< messages by channel
  std::map<std::uint16_t, std::vector<Entry>> entries_;  ///< of the chunk, by channel
  Times chunk_times_, times_;
  std::vector<ChunkIndex> chunks_;
};

}  // namespace epiline
