#include "drivers/flights/recordings/bag_content.h"

#include <algorithm>
#include <utility>

namespace epiline {

namespace {

/// False if the message is incomplete.
bool parse(const RosMessage& message, TopicContent& content, BagEntry& entry) {
  const std::string& type = content.topic.type;
  if (is_one_of(kImageTypes, type)) {
    const auto stamp = parse_stamp(message);
    if (stamp) entry.stamp = *stamp;
    if (content.entries.empty())
      if (const auto image = parse_image(type, message)) content.pixels = image->encoding;
    return stamp.has_value();
  }
  if (is_one_of(kImuTypes, type)) {
    const auto sample = parse_imu(message);
    if (sample) entry.imu = *sample;
    entry.stamp = entry.imu.stamp;
    return sample.has_value();
  }
  const auto pose = parse_pose(type, message);
  if (pose) entry.pose = *pose;
  entry.stamp = entry.pose.stamp;
  return pose.has_value();
}

void see(const BagMessage& message, TopicContent& content) {
  if (!content.fault.empty()) return;
  BagEntry entry;
  entry.recorded_ns = message.recorded_ns;
  entry.image = message.place;
  const RosMessage ros{content.encoding, message.bytes};
  if (parse(ros, content, entry)) {
    content.entries.push_back(entry);
  } else {
    content.fault = cut_short_text(content.topic, content.entries.size(), ros);
  }
}

bool is_zero(const double* v) { return v[0] == 0 && v[1] == 0 && v[2] == 0; }

}  // namespace

bool is_one_of(const std::vector<std::string>& types, const std::string& type) {
  return std::find(types.begin(), types.end(), type) != types.end();
}

std::string cut_short_text(const BagTopic& topic, std::size_t index, const RosMessage& message) {
  return "message " + std::to_string(index + 1) + " of " + topic.name + " ends after " +
         std::to_string(message.bytes.size()) + " bytes";
}

Result<BagContent> read_bag(const std::filesystem::path& path) {
  auto bag = Bag::open(path);
  if (!bag) return bag.error();
  BagContent content;
  content.bag = std::move(*bag);
  std::vector<TopicContent>& topics = content.topics;
  const auto add_new = [&] {
    for (std::size_t t = topics.size(); t < content.bag->topics().size(); ++t) {
      const BagTopic& topic = content.bag->topics()[t];
      topics.push_back({topic, topic.encoding == "cdr" ? RosEncoding::kCdr : RosEncoding::kRos1, {}, {}, {}});
    }
  };
  const Status scanned = content.bag->scan([&](const BagMessage& message) {
    add_new();
    TopicContent& topic = topics[message.topic];
    const bool is_read = is_one_of(kImageTypes, topic.topic.type) || is_one_of(kImuTypes, topic.topic.type) ||
                         is_one_of(kTruthTypes, topic.topic.type);
    const bool is_known = topic.topic.encoding == "ros1" || topic.topic.encoding == "cdr";
    if (is_read && is_known) see(message, topic);
  });
  if (!scanned) return scanned.error();
  add_new();
  const auto by_time = [](const BagEntry& a, const BagEntry& b) { return a.recorded_ns < b.recorded_ns; };
  for (TopicContent& topic : topics) std::stable_sort(topic.entries.begin(), topic.entries.end(), by_time);
  std::stable_sort(topics.begin(), topics.end(),
                   [](const TopicContent& a, const TopicContent& b) { return a.topic.name < b.topic.name; });
  return content;
}

void use_recorded_stamps(TopicContent& topic) {
  for (BagEntry& entry : topic.entries) entry.stamp = entry.imu.stamp = entry.pose.stamp = HostStamp{entry.recorded_ns};
}

bool mend_stamps(TopicContent& topic) {
  const auto& all = topic.entries;
  const bool is_one = std::all_of(all.begin(), all.end(), [&](const BagEntry& e) { return e.stamp == all[0].stamp; });
  if (all.empty() || !is_one || (all.size() == 1 && all[0].stamp.ns != 0)) return false;
  use_recorded_stamps(topic);
  return true;
}

bool has_rates(const TopicContent& imu) {
  return std::any_of(imu.entries.begin(), imu.entries.end(),
                     [](const BagEntry& e) { return !is_zero(&e.imu.angular_velocity_rad_s[0]); });
}
bool has_forces(const TopicContent& imu) {
  return std::any_of(imu.entries.begin(), imu.entries.end(),
                     [](const BagEntry& e) { return !is_zero(&e.imu.specific_force_m_s2[0]); });
}

std::vector<BagEntry> joined_imu(const TopicContent& gyroscope, const TopicContent& accelerometer) {
  std::vector<BagEntry> joined, forces = accelerometer.entries;
  std::stable_sort(forces.begin(), forces.end(),
                   [](const BagEntry& a, const BagEntry& b) { return a.stamp < b.stamp; });
  for (BagEntry entry : gyroscope.entries) {
    const auto after =
        std::partition_point(forces.begin(), forces.end(), [&](const BagEntry& e) { return e.stamp < entry.stamp; });
    if (after == forces.end() || (after == forces.begin() && after->stamp != entry.stamp)) continue;
    const auto before = after->stamp == entry.stamp ? after : after - 1;
    const double gap = static_cast<double>((after->stamp - before->stamp).ns);
    const double share = gap > 0 ? static_cast<double>((entry.stamp - before->stamp).ns) / gap : 0;
    for (int i = 0; i < 3; ++i) {
      const double a = before->imu.specific_force_m_s2[i];
      entry.imu.specific_force_m_s2[i] = a + share * (after->imu.specific_force_m_s2[i] - a);
    }
    joined.push_back(entry);
  }
  return joined;
}

}  // namespace epiline
