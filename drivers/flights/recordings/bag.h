#pragma once
// A bag of any format: a file, or the folder of a ROS 2 bag.
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/flights/recordings/bag_reader.h"

namespace epiline {

class Bag {
 public:
  /// Fails if and only if there is no such bag, or a file of it is missing or of no known format.
  static Result<std::unique_ptr<Bag>> open(const std::filesystem::path& path);

  /// Shows every message of every file once, unpacked. Fails if and only if a file is damaged before its end.
  Status scan(const BagReader::See& see);
  /// One message again, unpacked; valid until the next call.
  Result<std::span<const std::uint8_t>> read(const BagPlace& place);

  const std::filesystem::path& path() const { return path_; }
  const std::vector<BagTopic>& topics() const { return topics_; }
  /// Remarks for the user after scan().
  std::vector<std::string> notes() const;

 private:
  explicit Bag(std::filesystem::path path) : path_(std::move(path)) {}
  std::filesystem::path path_;
  std::vector<std::unique_ptr<BagReader>> files_;
  std::vector<BagTopic> topics_;  ///< of all files
  Bytes unpacked_;
};

/// The name or the first bytes of a file say so, or the folder holds a ROS 2 bag.
bool is_bag(const std::filesystem::path& path);

}  // namespace epiline
