#include "drivers/flights/recordings/bag.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <utility>

#include "pipeline/text/time_column.h"

namespace epiline {

namespace fs = std::filesystem;

namespace {

constexpr char kMetadata[] = "metadata.yaml";

bool has_name_of_bag(const fs::path& path) {
  std::string name = path.filename().string();
  for (const char* more : {".zstd", ".zst", ".active"})
    if (name.ends_with(more)) name.resize(name.size() - std::string_view(more).size());
  return name.ends_with(".bag") || name.ends_with(".mcap") || name.ends_with(".db3");
}

bool is_folder_of_bag(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored) && !fs::exists(path / "mav0", ignored) && !fs::exists(path / "imu0", ignored);
}

/// Parts of ROS 2 bags in the folder, by name. After an interruption there is no metadata.yaml to list them.
std::vector<fs::path> parts_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code ignored;
  for (auto at = fs::directory_iterator(folder, ignored); at != fs::directory_iterator(); at.increment(ignored)) {
    const bool is_ros1 = at->path().extension() == ".bag" || at->path().extension() == ".active";
    if (!is_ros1 && at->is_regular_file(ignored) && has_name_of_bag(at->path())) files.push_back(at->path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// NAME of NAME_0.mcap.
std::string bag_of(const fs::path& part) {
  const std::string name = part.filename().string();
  const std::string stem = name.substr(0, std::min(name.rfind(".mcap"), name.rfind(".db3")));
  const std::size_t number = stem.find_last_not_of("0123456789");
  return number != std::string::npos && stem[number] == '_' ? stem.substr(0, number) : stem;
}

Result<std::vector<fs::path>> listed_files(const fs::path& folder) {
  const fs::path list = folder / kMetadata;
  std::vector<fs::path> files;
  try {
    const YAML::Node about = YAML::LoadFile(list.string())["rosbag2_bagfile_information"];
    for (const auto& name : about["relative_file_paths"]) files.push_back(folder / name.as<std::string>());
  } catch (const std::exception& e) {
    return Error{ErrorKind::kUsage, list.string(), 0, std::string("cannot be read (") + e.what() + ")",
                 "the list that a ROS 2 recording writes; without the file, every bag in the folder is read"};
  }
  return files;
}

Result<std::vector<fs::path>> files_of(const fs::path& path) {
  const auto fail = [&](const fs::path& file, const char* found) {
    return Error{ErrorKind::kUsage, file.string(), 0, found,
                 "a bag: *.bag, *.mcap, *.db3, or the folder of a ROS 2 bag"};
  };
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return fail(path, "does not exist");
  if (!fs::is_directory(path, ignored)) return std::vector<fs::path>{path};
  auto files = fs::exists(path / kMetadata, ignored) ? listed_files(path) : parts_in(path);
  if (!files) return files.error();
  if (files->empty()) return fail(path, "holds no bag");
  if (bag_of(files->front()) != bag_of(files->back())) return fail(path, "holds several bags");
  for (fs::path& file : *files) {
    const fs::path packed = file.string() + ".zstd";  // older recorders list the name without it
    if (!fs::exists(file, ignored) && fs::exists(packed, ignored)) file = packed;
    if (!fs::exists(file, ignored)) return fail(file, "does not exist, though metadata.yaml lists it");
  }
  return files;
}

}  // namespace

bool is_bag(const fs::path& path) {
  std::error_code ignored;
  if (is_folder_of_bag(path)) return fs::exists(path / kMetadata, ignored) || !parts_in(path).empty();
  if (fs::is_directory(path, ignored)) return false;
  return has_name_of_bag(path) || looks_like_bag(path);
}

Result<std::unique_ptr<Bag>> Bag::open(const fs::path& path) {
  const auto files = files_of(path);
  if (!files) return files.error();
  std::unique_ptr<Bag> bag(new Bag(path));
  for (const fs::path& file : *files) {
    auto reader = open_bag_reader(file);
    if (!reader) return reader.error();
    bag->files_.push_back(std::move(*reader));
  }
  return bag;
}

Status Bag::scan(const BagReader::See& see) {
  for (std::size_t f = 0; f < files_.size(); ++f) {
    BagReader& file = *files_[f];
    std::vector<std::size_t> topic_of;  // of this file
    bool good = true;
    const Status scanned = file.scan([&](const BagMessage& message) {
      for (std::size_t t = topic_of.size(); t <= message.topic; ++t)
        topic_of.push_back(number_of(file.topics()[t], topics_));
      BagMessage shown = message;
      shown.topic = topic_of[message.topic];
      shown.recorded_ns = std::clamp(message.recorded_ns, -kLargestTime_ns, kLargestTime_ns);
      shown.place.file = static_cast<std::uint32_t>(f);
      if (is_zstd(message.bytes)) {
        good = good && unpack(Packing::kZstd, message.bytes, kUnknownSize, unpacked_);
        if (!good) return;
        shown.bytes = unpacked_;
      }
      see(shown);
    });
    if (!scanned) return scanned;
    if (!good) {
      return Error{ErrorKind::kUsage, path_.string(), 0, "cannot be read as a bag (a message that cannot be unpacked)",
                   "an undamaged bag"};
    }
    for (const BagTopic& topic : file.topics()) number_of(topic, topics_);
  }
  return Done{};
}

Result<std::span<const std::uint8_t>> Bag::read(const BagPlace& place) {
  const auto bytes = files_[place.file]->read(place);
  if (!bytes || !is_zstd(*bytes)) return bytes;
  if (!unpack(Packing::kZstd, *bytes, kUnknownSize, unpacked_)) {
    return Error{ErrorKind::kUsage, path_.string(), 0, "holds a message that cannot be unpacked", "an undamaged bag"};
  }
  return std::span<const std::uint8_t>(unpacked_);
}

std::vector<std::string> Bag::notes() const {
  std::vector<std::string> notes;
  for (const auto& file : files_)
    if (!file->note().empty()) notes.push_back(file->note());
  return notes;
}

}  // namespace epiline
