#include "drivers/flights/recordings/bag_dataset.h"

#include <algorithm>
#include <utility>
#include <vector>

#ifdef EPILINE_ROSBAG
#include <console_bridge/console.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <map>

#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/flights/recordings/image_source.h"
#include "drivers/flights/recordings/ros_message.h"
#endif

namespace epiline {

namespace fs = std::filesystem;

bool is_bag(const fs::path& path) { return path.extension() == ".bag"; }

#ifndef EPILINE_ROSBAG

namespace {
Error built_without(const fs::path& bag) {
  return {ErrorKind::kUsage, bag.string(), 0, "is a ROS bag, which this program was built without",
          "a build with librosbag-storage-dev installed, or an ASL folder"};
}
}  // namespace

Result<AslDataset> open_bag_dataset(const fs::path& bag, const BagTopics& /*topics*/, const std::string& /*camera*/,
                                    const fs::path& /*camera_file*/, const fs::path& /*imu_file*/) {
  return built_without(bag);
}

Result<std::optional<Trajectory>> read_bag_ground_truth(const fs::path& bag, const std::string& /*topic*/) {
  return built_without(bag);
}

#else

namespace {

using Bytes = std::vector<std::uint8_t>;
using Types = std::vector<std::string>;

const Types kImageTypes = {"sensor_msgs/Image", "sensor_msgs/CompressedImage"};
const Types kImuTypes = {"sensor_msgs/Imu"};
const Types kTruthTypes = {"geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped", "nav_msgs/Odometry"};

bool has(const Types& types, const std::string& type) {
  return std::find(types.begin(), types.end(), type) != types.end();
}

std::string joined(const Types& list) {
  std::string s;
  for (const std::string& item : list) s.append(s.empty() ? "" : ", ").append(item);
  return s.empty() ? "none" : s;
}

struct Topic {
  std::string name, type;
};

/// An open bag. Its library speaks in exceptions; none leaves open_bag_dataset().
class OpenBag {
 public:
  explicit OpenBag(const fs::path& path) : path_(path) {
    console_bridge::noOutputHandler();  // our line is the only one on stderr
    bag_.open(path.string(), rosbag::bagmode::Read);
    rosbag::View all(bag_);
    for (const rosbag::ConnectionInfo* connection : all.getConnections())
      types_[connection->topic] = connection->datatype;
  }

  const rosbag::Bag& bag() const { return bag_; }
  const fs::path& path() const { return path_; }

  Types topics_of(const Types& types) const {
    Types names;
    for (const auto& [name, type] : types_) {
      if (has(types, type)) names.push_back(name);
    }
    return names;
  }

  /// The topic asked for, or the first of these types; none if there is none and none was asked for.
  Result<std::optional<Topic>> choose(const std::string& asked_for, const Types& types, Types& notes) const {
    const Types fitting = topics_of(types);
    if (!asked_for.empty()) {
      const auto found = types_.find(asked_for);
      if (found == types_.end()) return complaint("has no topic " + asked_for, "one of " + joined(fitting));
      if (!has(types, found->second))
        return complaint("topic " + asked_for + " has the type " + found->second, "a topic of " + joined(types));
      return std::optional<Topic>({found->first, found->second});
    }
    if (fitting.empty()) return std::optional<Topic>{};
    if (fitting.size() > 1) {
      notes.push_back(path_.string() + ": " + fitting[0] + " is used; the bag also has " +
                      joined({fitting.begin() + 1, fitting.end()}));
    }
    return std::optional<Topic>({fitting[0], types_.at(fitting[0])});
  }

  Error complaint(std::string found, std::string expected) const {
    return {ErrorKind::kUsage, path_.string(), 0, std::move(found), std::move(expected)};
  }

 private:
  fs::path path_;
  rosbag::Bag bag_;
  std::map<std::string, std::string> types_;  ///< by topic
};

/// The messages of one topic in the order they were recorded.
class Messages {
 public:
  Messages(const OpenBag& bag, const std::string& topic)
      : bag_(bag),
        topic_(topic),
        view_(bag.bag(), [topic](const rosbag::ConnectionInfo* c) { return c->topic == topic; }),
        next_(view_.begin()) {}

  /// The bytes of the next one; false after the last.
  bool next(Bytes& bytes) {
    constexpr std::uint32_t kLongest = 1U << 29;  // a damaged length must not fill the memory
    if (next_ == view_.end()) return false;
    const std::uint32_t size = next_->size();
    if (size > kLongest) throw rosbag::BagFormatException("a message of " + std::to_string(size) + " bytes");
    bytes.resize(size);
    ros::serialization::OStream stream(bytes.data(), size);
    next_->write(stream);
    ++next_;
    ++count_;
    return true;
  }
  void skip() {
    ++next_;
    ++count_;
  }
  void rewind() {
    next_ = view_.begin();
    count_ = 0;
  }
  /// Taken so far.
  std::size_t count() const { return count_; }

  Error cut_short(std::size_t size) const {
    return bag_.complaint(
        "message " + std::to_string(count_) + " of " + topic_ + " ends after " + std::to_string(size) + " bytes",
        "a complete message");
  }

 private:
  const OpenBag& bag_;
  std::string topic_;
  rosbag::View view_;
  rosbag::View::iterator next_;
  std::size_t count_ = 0;
};

/// Bytes of a pixel in an encoding that can become grey; 0: in none.
int bytes_per_pixel(const std::string& encoding) {
  if (encoding == "mono8" || encoding == "8UC1") return 1;
  if (encoding == "mono16" || encoding == "16UC1") return 2;
  return encoding == "bgr8" || encoding == "rgb8" ? 3 : 0;
}

/// One row of an image as grey: of 16 bits the upper eight, of colours the luma of ITU-R BT.601.
void to_grey(const RosImage& image, const std::uint8_t* row, int bytes, std::uint8_t* out) {
  const int high = image.big_endian ? 0 : 1, red = image.encoding == "rgb8" ? 0 : 2;
  for (std::uint32_t x = 0; x < image.width; ++x, row += bytes) {
    if (bytes == 1) out[x] = row[0];
    if (bytes == 2) out[x] = row[high];
    if (bytes == 3)
      out[x] = static_cast<std::uint8_t>((4899 * row[red] + 9617 * row[1] + 1868 * row[2 - red] + 8192) >> 14);
  }
}

class BagImages final : public ImageSource {
 public:
  BagImages(std::shared_ptr<const OpenBag> bag, const Topic& topic)
      : bag_(std::move(bag)), topic_(topic), messages_(*bag_, topic.name) {}

  Status read(std::size_t index, GreyImage& grey) override {
    try {
      if (index < messages_.count()) messages_.rewind();
      while (messages_.count() < index) messages_.skip();
      messages_.next(message_);
    } catch (const std::exception& e) {
      return complaint(index, std::string("cannot be read: ") + e.what(), "an undamaged bag");
    }
    return topic_.type == "sensor_msgs/Image" ? raw(index, grey) : compressed(index, grey);
  }

  Error complaint(std::size_t index, std::string found, std::string expected) const override {
    return bag_->complaint("image " + std::to_string(index + 1) + " of " + topic_.name + " " + std::move(found),
                           std::move(expected));
  }

 private:
  Status raw(std::size_t index, GreyImage& grey) const {
    constexpr std::uint32_t kLargest = 1U << 15;
    const auto image = parse_image(message_);
    if (!image) return messages_.cut_short(message_.size());
    const int bytes = bytes_per_pixel(image->encoding);
    if (bytes == 0)
      return complaint(index, "has the encoding \"" + image->encoding + "\"",
                       "mono8, 8UC1, mono16, 16UC1, bgr8 or rgb8");
    const bool sizes = image->width > 0 && image->height > 0 && image->width <= kLargest && image->height <= kLargest;
    if (!sizes || image->step < image->width * static_cast<std::uint32_t>(bytes))
      return complaint(index,
                       "has " + std::to_string(image->width) + "x" + std::to_string(image->height) +
                           " pixels in rows of " + std::to_string(image->step) + " bytes",
                       "rows at least as long as their pixels");
    grey.resize(static_cast<int>(image->width), static_cast<int>(image->height));
    for (std::uint32_t y = 0; y < image->height; ++y)
      to_grey(*image, image->data + std::size_t{y} * image->step, bytes, grey.row(static_cast<int>(y)));
    return Done{};
  }

  Status compressed(std::size_t index, GreyImage& grey) const {
    const auto image = parse_compressed_image(message_);
    if (!image) return messages_.cut_short(message_.size());
    if (!decode_image(image->data, image->size, grey))
      return complaint(index, "cannot be decoded", "a complete PNG or JPEG");
    return Done{};
  }

  std::shared_ptr<const OpenBag> bag_;
  Topic topic_;
  Messages messages_;
  Bytes message_;
};

Status read_images(const std::shared_ptr<const OpenBag>& bag, const std::string& asked_for, AslDataset& d) {
  const auto topic = bag->choose(asked_for, kImageTypes, d.notes);
  if (!topic) return topic.error();
  if (!*topic) return bag->complaint("has no images", "a topic of " + joined(kImageTypes));
  Messages messages(*bag, (*topic)->name);
  for (Bytes message; messages.next(message);) {
    const auto stamp = parse_stamp(message);
    if (!stamp) return messages.cut_short(message.size());
    d.images.push_back({*stamp, {}, 0});
  }
  if (d.images.empty()) return bag->complaint("topic " + (*topic)->name + " has no message", "images");
  d.image_source = std::make_shared<BagImages>(bag, **topic);
  return Done{};
}

Status read_imu(const OpenBag& bag, const std::string& asked_for, AslDataset& d) {
  const auto topic = bag.choose(asked_for, kImuTypes, d.notes);
  if (!topic) return topic.error();
  if (!*topic) return bag.complaint("has no IMU", "a topic of " + joined(kImuTypes));
  Messages messages(bag, (*topic)->name);
  for (Bytes message; messages.next(message);) {
    const auto sample = parse_imu(message);
    if (!sample) return messages.cut_short(message.size());
    d.imu_samples.push_back(*sample);
  }
  if (d.imu_samples.empty()) return bag.complaint("topic " + (*topic)->name + " has no message", "IMU samples");
  return Done{};
}

Result<std::optional<Trajectory>> read_truth(const OpenBag& bag, const std::string& asked_for, Types& notes) {
  const auto topic = bag.choose(asked_for, kTruthTypes, notes);
  if (!topic) return topic.error();
  for (const std::string& position : bag.topics_of({"geometry_msgs/PointStamped"}))
    notes.push_back(bag.path().string() + ": " + position + " has positions only and is not used as ground truth");
  if (!*topic) return std::optional<Trajectory>{};
  Messages messages(bag, (*topic)->name);
  Trajectory truth;
  for (Bytes message; messages.next(message);) {
    const auto pose = parse_pose((*topic)->type, message);
    if (!pose) return messages.cut_short(message.size());
    add_pose(*pose, truth);
  }
  if (truth.poses.empty()) return std::optional<Trajectory>{};
  return std::optional<Trajectory>{std::move(truth)};
}

/// Opens the bag and hands it to `use`; what the library throws becomes an error.
template <class Use>
auto with_bag(const fs::path& path, Use use) -> decltype(use(std::shared_ptr<const OpenBag>())) {
  const auto fail = [&](std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, path.string(), 0, std::move(found), std::move(expected)};
  };
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return fail("does not exist", "a data set: an ASL folder, or a ROS 1 bag (*.bag)");
  if (fs::is_directory(path, ignored)) return fail("is a folder", "a ROS 1 bag, because its name ends in .bag");
  try {
    return use(std::make_shared<const OpenBag>(path));
  } catch (const rosbag::BagUnindexedException&) {
    return fail("has no index, because it was not closed", "an indexed bag (`rosbag reindex` repairs it)");
  } catch (const std::exception& e) {
    return fail(std::string("cannot be read as a bag (") + e.what() + ")", "an undamaged ROS 1 bag (format 2.0)");
  }
}

Status read_calibrations(const fs::path& bag, const std::string& camera, const fs::path& camera_file,
                         const fs::path& imu_file, AslDataset& d) {
  const char* missing = camera_file.empty() ? "[camera] calibration" : imu_file.empty() ? "[imu] calibration" : nullptr;
  if (missing) {
    return Error{ErrorKind::kUsage, bag.string(), 0, "holds no calibration",
                 std::string("--config with a file that sets ") + missing};
  }
  const auto read_camera = read_camera_calibration(camera_file, camera);
  if (!read_camera) return read_camera.error();
  d.camera = *read_camera;
  const auto read_imu = read_imu_calibration(imu_file);
  if (!read_imu) return read_imu.error();
  d.imu = *read_imu;
  return Done{};
}

}  // namespace

Result<AslDataset> open_bag_dataset(const fs::path& path, const BagTopics& topics, const std::string& camera,
                                    const fs::path& camera_file, const fs::path& imu_file) {
  return with_bag(path, [&](const std::shared_ptr<const OpenBag>& bag) -> Result<AslDataset> {
    AslDataset d;
    d.root = d.imu_file = d.truth_file = d.image_list = path;
    if (const Status s = read_calibrations(path, camera, camera_file, imu_file, d); !s) return s.error();
    if (const Status s = read_images(bag, topics.image, d); !s) return s.error();
    if (const Status s = read_imu(*bag, topics.imu, d); !s) return s.error();
    auto truth = read_truth(*bag, topics.truth, d.notes);
    if (!truth) return truth.error();
    d.ground_truth = std::move(*truth);
    return d;
  });
}

Result<std::optional<Trajectory>> read_bag_ground_truth(const fs::path& path, const std::string& topic) {
  return with_bag(path, [&](const std::shared_ptr<const OpenBag>& bag) {
    Types notes;
    return read_truth(*bag, topic, notes);
  });
}

#endif

}  // namespace epiline
