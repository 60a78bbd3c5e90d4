#include "drivers/flights/recordings/bag_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "drivers/flights/recordings/bag_content.h"
#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/flights/recordings/image_source.h"
#include "drivers/flights/recordings/ros_image.h"

namespace epiline {

namespace fs = std::filesystem;

namespace {

using Names = std::vector<std::string>;

std::string joined(const Names& list) { return list.empty() ? "none" : fmt::format("{}", fmt::join(list, ", ")); }

Error complaint(const Bag& bag, std::string found, std::string expected) {
  return {ErrorKind::kUsage, bag.path().string(), 0, std::move(found), std::move(expected)};
}

bool shows_depth(const TopicContent& topic) {
  return topic.topic.name.find("depth") != std::string::npos || is_depth(topic.pixels);
}

/// What epiline itself wrote (replay --mcap) is no ground truth.
bool is_own_estimate(const TopicContent* topic) { return topic->topic.name.starts_with("/epiline/"); }

/// Chooses topics of a bag.
class Topics {
 public:
  explicit Topics(BagContent& content) : content_(content) {}

  std::vector<TopicContent*> of(const Names& types) const {
    std::vector<TopicContent*> fitting;
    for (TopicContent& topic : content_.topics)
      if (is_one_of(types, topic.topic.type)) fitting.push_back(&topic);
    return fitting;
  }

  /// The topic asked for, or the first of these types; null if there is none and none was asked for.
  Result<TopicContent*> choose(const std::string& asked_for, const Names& types, Names& notes) const {
    std::vector<TopicContent*> fitting = of(types);
    // distances come last, and are never taken unasked where a name says what they are
    std::stable_partition(fitting.begin(), fitting.end(), [](const TopicContent* t) { return !shows_depth(*t); });
    if (asked_for.empty()) std::erase_if(fitting, is_own_estimate);
    Names names;
    for (const TopicContent* topic : fitting) names.push_back(topic->topic.name);
    if (!asked_for.empty()) return asked(asked_for, types, names);
    if (fitting.empty()) return static_cast<TopicContent*>(nullptr);
    TopicContent* const first = fitting.front();
    if (first->topic.name.find("depth") != std::string::npos)
      return complaint(*content_.bag, "has no image but " + joined(names), "a topic that shows no distances (depth)");
    if (names.size() > 1)
      notes.push_back(content_.bag->path().string() + ": " + names[0] + " is used; the bag also has " +
                      joined({names.begin() + 1, names.end()}));
    return readable(first);
  }

 private:
  Result<TopicContent*> asked(const std::string& name, const Names& types, const Names& fitting) const {
    const Bag& bag = *content_.bag;
    const TopicContent* other = nullptr;
    for (TopicContent& topic : content_.topics) {
      if (topic.topic.name != name) continue;
      if (is_one_of(types, topic.topic.type)) return readable(&topic);
      other = &topic;
    }
    if (other != nullptr)
      return complaint(bag, "topic " + name + " has the type " + other->topic.type, "a topic of " + joined(types));
    return complaint(bag, "has no topic " + name, "one of " + joined(fitting));
  }

  Result<TopicContent*> readable(TopicContent* topic) const {
    const std::string& encoding = topic->topic.encoding;
    if (encoding != "cdr" && encoding != "ros1")
      return complaint(*content_.bag, "topic " + topic->topic.name + " has messages encoded as \"" + encoding + "\"",
                       "cdr (ROS 2) or ros1");
    if (!topic->fault.empty()) return complaint(*content_.bag, topic->fault, "a complete message");
    return topic;
  }

  BagContent& content_;
};

class BagImages final : public ImageSource {
 public:
  BagImages(std::unique_ptr<Bag> bag, const TopicContent& topic)
      : bag_(std::move(bag)), topic_(topic.topic), encoding_(topic.encoding) {
    for (const BagEntry& entry : topic.entries) places_.push_back(entry.image);
  }

  Error complaint(std::size_t index, std::string found, std::string expected) const override {
    return epiline::complaint(*bag_,
                              "image " + std::to_string(index + 1) + " of " + topic_.name + " " + std::move(found),
                              std::move(expected));
  }

 private:
  std::size_t count() const override { return places_.size(); }
  Status decode(std::size_t index, GreyImage& grey) override {
    const auto bytes = bag_->read(places_[index]);
    if (!bytes) return complaint(index, "cannot be read: " + bytes.error().found, "an undamaged bag");
    const RosMessage message{encoding_, *bytes};
    const auto image = parse_image(topic_.type, message);
    if (!image) return epiline::complaint(*bag_, cut_short_text(topic_, index, message), "a complete message");
    if (topic_.type == kImageTypes[0]) {
      if (const auto fault = to_grey(*image, grey)) return complaint(index, fault->found, fault->expected);
    } else if (!decode_image(image->data.data(), image->data.size(), grey)) {
      return complaint(index, "cannot be decoded", "a complete PNG or JPEG");
    }
    return Done{};
  }

  std::unique_ptr<Bag> bag_;
  BagTopic topic_;
  RosEncoding encoding_;
  std::vector<BagPlace> places_;
};

Result<TopicContent*> choose_images(const Topics& topics, const Bag& bag, const std::string& asked_for, Names& notes) {
  const auto topic = topics.choose(asked_for, kImageTypes, notes);
  if (!topic) return topic.error();
  if (*topic == nullptr) return complaint(bag, "has no images", "a topic of " + joined(kImageTypes));
  if ((*topic)->entries.empty()) return complaint(bag, "topic " + (*topic)->topic.name + " has no message", "images");
  return topic;
}

/// A topic of rates alone is joined with the first one of forces alone: drivers with two sensors write them so.
Status complete_imu(const Topics& topics, const Bag& bag, TopicContent& chosen, Names& notes) {
  const bool rates = has_rates(chosen), forces = has_forces(chosen);
  if (rates == forces) return Done{};
  for (TopicContent* other : topics.of(kImuTypes)) {
    if (has_rates(*other) == rates || has_forces(*other) == forces || !other->fault.empty()) continue;
    mend_stamps(*other);
    auto entries = rates ? joined_imu(chosen, *other) : joined_imu(*other, chosen);
    if (entries.empty()) continue;
    notes.push_back(bag.path().string() + ": " + (rates ? chosen : *other).topic.name + " (gyroscope) and " +
                    (rates ? *other : chosen).topic.name + " (accelerometer) are joined to one IMU");
    chosen.entries = std::move(entries);
    return Done{};
  }
  return complaint(
      bag,
      "topic " + chosen.topic.name + " holds " + (rates ? "rates, but no acceleration" : "accelerations, but no rates"),
      "a topic with both, or two that cover the same time");
}

Result<TopicContent*> choose_imu(const Topics& topics, const Bag& bag, const std::string& asked_for, Names& notes) {
  Names of_choice;
  const auto topic = topics.choose(asked_for, kImuTypes, of_choice);
  if (!topic) return topic.error();
  if (*topic == nullptr) return complaint(bag, "has no IMU", "a topic of " + joined(kImuTypes));
  TopicContent* chosen = *topic;
  if (asked_for.empty()) {  // one with both goes before halves
    for (TopicContent* other : topics.of(kImuTypes))
      if (other->fault.empty() && has_rates(*other) && has_forces(*other)) {
        if (!(has_rates(*chosen) && has_forces(*chosen))) chosen = other, of_choice.clear();
        break;
      }
  }
  if (chosen->entries.empty()) return complaint(bag, "topic " + chosen->topic.name + " has no message", "IMU samples");
  if (mend_stamps(*chosen))
    notes.push_back(chosen->topic.name + ": no stamps in the headers; those of the recording are used");
  Names joins;
  if (const Status s = complete_imu(topics, bag, *chosen, joins); !s) return s.error();
  const Names& told = joins.empty() ? of_choice : joins;
  notes.insert(notes.end(), told.begin(), told.end());
  return chosen;
}

bool meet(const TopicContent& a, const TopicContent& b) {
  const auto earlier = [](const BagEntry& x, const BagEntry& y) { return x.stamp < y.stamp; };
  const auto [a0, a1] = std::minmax_element(a.entries.begin(), a.entries.end(), earlier);
  const auto [b0, b1] = std::minmax_element(b.entries.begin(), b.entries.end(), earlier);
  return !(a1->stamp < b0->stamp) && !(b1->stamp < a0->stamp);
}

/// Headers of two clocks have no time in common; the recording has one clock.
void bring_together(TopicContent& images, TopicContent& imu, Names& notes) {
  if (meet(images, imu)) return;
  TopicContent as_recorded[] = {images, imu};
  for (TopicContent& topic : as_recorded) use_recorded_stamps(topic);
  if (!meet(as_recorded[0], as_recorded[1])) return;
  images = std::move(as_recorded[0]);
  imu = std::move(as_recorded[1]);
  notes.push_back("stamps in the headers of " + images.topic.name + " and " + imu.topic.name +
                  " have no time in common; those of the recording are used");
}

Result<std::optional<Trajectory>> read_truth(const Topics& topics, const Bag& bag, const std::string& asked_for,
                                             Names& notes) {
  const auto topic = topics.choose(asked_for, kTruthTypes, notes);
  if (!topic) return topic.error();
  for (const TopicContent* position : topics.of({"geometry_msgs/PointStamped"}))
    notes.push_back(bag.path().string() + ": " + position->topic.name +
                    " has positions only and is not used as ground truth");
  if (*topic == nullptr) return std::optional<Trajectory>{};
  mend_stamps(**topic);
  Trajectory truth;
  for (const BagEntry& entry : (*topic)->entries) add_pose(entry.pose, truth);
  if (truth.poses.empty()) return std::optional<Trajectory>{};
  return std::optional<Trajectory>{std::move(truth)};
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
  AslDataset d;
  d.root = d.imu_file = d.truth_file = d.image_list = path;
  std::error_code ignored;
  if (fs::exists(path, ignored))
    if (const Status s = read_calibrations(path, camera, camera_file, imu_file, d); !s) return s.error();
  auto content = read_bag(path);
  if (!content) return content.error();
  d.notes = content->bag->notes();
  const Topics choice(*content);
  const auto images = choose_images(choice, *content->bag, topics.image, d.notes);
  if (!images) return images.error();
  if (mend_stamps(**images))
    d.notes.push_back((*images)->topic.name + ": no stamps in the headers; those of the recording are used");
  const auto imu = choose_imu(choice, *content->bag, topics.imu, d.notes);
  if (!imu) return imu.error();
  bring_together(**images, **imu, d.notes);
  auto truth = read_truth(choice, *content->bag, topics.truth, d.notes);
  if (!truth) return truth.error();
  d.ground_truth = std::move(*truth);
  for (const BagEntry& entry : (*images)->entries) d.images.push_back({entry.stamp, {}, 0});
  for (const BagEntry& entry : (*imu)->entries) d.imu_samples.push_back(entry.imu);
  d.image_source = std::make_shared<BagImages>(std::move(content->bag), **images);
  return d;
}

}  // namespace epiline
