#include "drivers/sensors/camera/media_graph.h"

#include <fcntl.h>
#include <linux/v4l2-controls.h>
#include <linux/videodev2.h>
#include <sys/sysmacros.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string_view>

#include "drivers/sensors/trouble.h"

namespace epiline {

namespace {

constexpr int kMostGraphs = 16;

bool is_data(const media_v2_link& link) noexcept {
  return (link.flags & MEDIA_LNK_FL_LINK_TYPE) == MEDIA_LNK_FL_DATA_LINK;
}
bool is_sensor(const media_v2_entity& entity) noexcept { return entity.function == MEDIA_ENT_F_CAM_SENSOR; }

template <class Item>
const Item* with_id(std::span<const Item> items, std::uint32_t id) noexcept {
  const auto found = std::find_if(items.begin(), items.end(), [id](const Item& item) { return item.id == id; });
  return found == items.end() ? nullptr : &*found;
}

template <class Items>
__u64 address(Items& items) noexcept {
  return reinterpret_cast<__u64>(items.data());
}

}  // namespace

// ---- reading it ----

bool MediaGraph::open(std::uint64_t video_node) noexcept {
  close();
  if (video_node == 0) return false;
  for (int i = 0; i < kMostGraphs; ++i) {
    char path[32];
    std::snprintf(path, sizeof(path), "/dev/media%d", i);
    fd_ = system_.open(path, O_RDWR);
    if (fd_ < 0) continue;
    node_ = read_topology() ? entity_of_node(video_node) : nullptr;
    if (node_ != nullptr) return true;
    close();
  }
  return false;
}

void MediaGraph::close() noexcept {
  close_way();
  if (fd_ >= 0) system_.close(fd_);
  fd_ = -1;
  node_ = nullptr;
}

/// False: the graph is larger than any that is known, or changes all the time.
bool MediaGraph::read_topology() noexcept {
  topology_ = {};
  if (call(fd_, MEDIA_IOC_G_TOPOLOGY, &topology_) != 0) return false;
  const bool fits = topology_.num_entities <= kMostEntities && topology_.num_interfaces <= kMostInterfaces &&
                    topology_.num_pads <= kMostPads && topology_.num_links <= kMostLinks;
  topology_.ptr_entities = address(entities_);
  topology_.ptr_interfaces = address(interfaces_);
  topology_.ptr_pads = address(pads_);
  topology_.ptr_links = address(links_);
  return fits && call(fd_, MEDIA_IOC_G_TOPOLOGY, &topology_) == 0;
}

const media_v2_entity* MediaGraph::entity(std::uint32_t id) const noexcept { return with_id(entities(), id); }
const media_v2_pad* MediaGraph::pad(std::uint32_t id) const noexcept { return with_id(pads(), id); }
const media_v2_entity* MediaGraph::entity_of_pad(std::uint32_t id) const noexcept {
  const media_v2_pad* const one = pad(id);
  return one != nullptr ? entity(one->entity_id) : nullptr;
}

const media_v2_interface* MediaGraph::interface_of(const media_v2_entity& wanted) const noexcept {
  for (const media_v2_link& link : links()) {
    if ((link.flags & MEDIA_LNK_FL_LINK_TYPE) == MEDIA_LNK_FL_INTERFACE_LINK && link.sink_id == wanted.id)
      return with_id(interfaces(), link.source_id);
  }
  return nullptr;
}

const media_v2_entity* MediaGraph::entity_of_node(std::uint64_t video_node) const noexcept {
  for (const media_v2_entity& candidate : entities()) {
    const media_v2_interface* const interface = interface_of(candidate);
    if (interface != nullptr && makedev(interface->devnode.major, interface->devnode.minor) == video_node)
      return &candidate;
  }
  return nullptr;
}

// ---- the way from the sensor ----

/// Backwards along all links, enabled or not: for each entity the first link of its shortest way to the node.
void MediaGraph::search(const media_v2_entity& from) noexcept {
  link_to_node_.fill(0);
  std::array<const media_v2_entity*, kMostEntities> seen{&from};
  std::size_t count = 1;
  for (std::size_t next = 0; next < count; ++next) {
    for (const media_v2_link& link : links()) {
      if (!is_data(link) || entity_of_pad(link.sink_id) != seen[next]) continue;
      const media_v2_entity* const before = entity_of_pad(link.source_id);
      const auto end = seen.begin() + static_cast<std::ptrdiff_t>(count);
      if (before == nullptr || std::find(seen.begin(), end, before) != end) continue;
      link_to_node_[place(*before)] = link.id;
      seen[count++] = before;
    }
  }
}

const media_v2_entity* MediaGraph::choose_sensor(const char* wanted, DeviceTrouble& trouble) noexcept {
  const media_v2_entity* chosen = nullptr;
  char names[sizeof(trouble.expected)] = "";
  int count = 0;
  for (const media_v2_entity& candidate : entities()) {
    if (!is_sensor(candidate) || link_to_node_[place(candidate)] == 0) continue;
    const std::size_t used = std::strlen(names);
    std::snprintf(names + used, sizeof(names) - used, "%s\"%s\"", used > 0 ? ", " : "", candidate.name);
    if (std::string_view(candidate.name).find(wanted) == std::string_view::npos) continue;
    chosen = &candidate;
    ++count;
  }
  if (count == 1 || (count == 0 && wanted[0] == '\0')) return chosen;
  trouble = unexpected("camera.sensor", names[0] == '\0' ? "none" : names,
                       count == 0 ? "no sensor \"%.60s\" leads to %.60s" : "several sensors \"%.60s\" lead to %.60s",
                       wanted, node_name());
  return nullptr;
}

DeviceTrouble MediaGraph::find_way(const char* wanted) noexcept {
  close_way();
  DeviceTrouble trouble;
  if (node_ == nullptr) return trouble;
  search(*node_);
  const media_v2_entity* const sensor = choose_sensor(wanted, trouble);
  if (sensor != nullptr && interface_of(*sensor) != nullptr && !open_way(*sensor)) {
    trouble = refused("the sub-devices of the camera's media graph", errno);
    close_way();
  }
  return trouble;
}

bool MediaGraph::open_way(const media_v2_entity& sensor) noexcept {
  const media_v2_pad* in = nullptr;
  for (const media_v2_entity* at = &sensor; at != node_;) {
    const media_v2_link* const link = with_id(links(), link_to_node_[place(*at)]);
    const media_v2_interface* const interface = interface_of(*at);
    if (link == nullptr || interface == nullptr || steps_ == kMostSteps) return errno = ENODEV, false;
    const int fd = open_sub_device(*interface);
    if (fd < 0) return false;
    way_[steps_++] = {at, in, pad(link->source_id), fd};
    in = pad(link->sink_id);
    at = entity(in->entity_id);
    if (at == nullptr) return errno = ENODEV, false;
  }
  return true;
}

void MediaGraph::close_way() noexcept {
  for (std::size_t i = 0; i < steps_; ++i) system_.close(way_[i].fd);
  steps_ = 0;
}

/// The kernel tells a device's file name by its number.
int MediaGraph::open_sub_device(const media_v2_interface& interface) noexcept {
  char path[64], text[256];
  std::snprintf(path, sizeof(path), "/sys/dev/char/%u:%u/uevent", interface.devnode.major, interface.devnode.minor);
  const int file = system_.open(path, O_RDONLY);
  if (file < 0) return -1;
  const ssize_t length = system_.read(file, text, sizeof(text) - 1);
  system_.close(file);
  if (length < 0) return -1;
  text[length] = '\0';
  constexpr const char kEntry[] = "DEVNAME=";
  const char* const name = std::strstr(text, kEntry);
  if (name == nullptr) return errno = ENODEV, -1;
  const char* const begin = name + sizeof(kEntry) - 1;
  std::snprintf(path, sizeof(path), "/dev/%.*s", static_cast<int>(std::strcspn(begin, "\n")), begin);
  return system_.open(path, O_RDWR);
}

// ---- setting it up ----

bool MediaGraph::set_link(const media_v2_link& link, bool enabled) noexcept {
  const media_v2_pad *const source = pad(link.source_id), *const sink = pad(link.sink_id);
  if (source == nullptr || sink == nullptr) return false;
  media_link_desc wish{};
  wish.source = {source->entity_id, static_cast<__u16>(source->index), MEDIA_PAD_FL_SOURCE, {}};
  wish.sink = {sink->entity_id, static_cast<__u16>(sink->index), MEDIA_PAD_FL_SINK, {}};
  // up to 2025 the kernel refuses a change of any other flag
  wish.flags = (link.flags & ~static_cast<__u32>(MEDIA_LNK_FL_ENABLED)) | (enabled ? MEDIA_LNK_FL_ENABLED : 0);
  return call(fd_, MEDIA_IOC_SETUP_LINK, &wish) == 0;
}

DeviceTrouble MediaGraph::link() noexcept {
  const auto is_ours = [&](const media_v2_link& link) {
    return std::any_of(way_.begin(), way_.begin() + static_cast<std::ptrdiff_t>(steps_),
                       [&](const Step& step) { return link_to_node_[place(*step.entity)] == link.id; });
  };
  const auto meets_ours = [&](const media_v2_link& other) {
    return std::any_of(links().begin(), links().end(), [&](const media_v2_link& ours) {
      return is_ours(ours) && (ours.source_id == other.source_id || ours.sink_id == other.sink_id);
    });
  };
  // of an entity that a link beside our way, which cannot be disabled, leads to: what it makes of our images goes
  // nowhere
  const auto leaves_branch = [&](const media_v2_link& other) {
    return std::any_of(links().begin(), links().end(), [&](const media_v2_link& branch) {
      return is_data(branch) && !is_ours(branch) && (branch.flags & MEDIA_LNK_FL_IMMUTABLE) != 0 &&
             meets_ours(branch) && entity_of_pad(branch.sink_id) == entity_of_pad(other.source_id);
    });
  };
  for (const bool enabled : {false, true}) {
    for (const media_v2_link& link : links()) {
      const bool is_wanted = is_ours(link), is_enabled = (link.flags & MEDIA_LNK_FL_ENABLED) != 0;
      const bool is_fixed = (link.flags & MEDIA_LNK_FL_IMMUTABLE) != 0;
      const media_v2_entity *const from = entity_of_pad(link.source_id), *const to = entity_of_pad(link.sink_id);
      if (from == nullptr || to == nullptr) continue;  // no graph of the kernel's
      if (!is_data(link) || is_fixed || is_wanted != enabled || is_enabled == enabled) continue;
      if (!meets_ours(link) && !leaves_branch(link)) continue;
      if (set_link(link, enabled)) continue;
      DeviceTrouble trouble = device_refusal("MEDIA_IOC_SETUP_LINK", errno);
      std::snprintf(trouble.found, sizeof(trouble.found), "cannot %s the link from %.50s to %.50s",
                    enabled ? "enable" : "disable", from->name, to->name);
      return trouble;
    }
  }
  return {};
}

bool MediaGraph::set_pad(int sub_device, const media_v2_pad& at, BusFormat& format, std::uint32_t which) noexcept {
  v4l2_subdev_format wish{};
  wish.which = which;
  wish.pad = at.index;
  wish.format.code = static_cast<decltype(wish.format.code)>(format.code);
  wish.format.width = static_cast<__u32>(format.width);
  wish.format.height = static_cast<__u32>(format.height);
  wish.format.field = V4L2_FIELD_NONE;
  if (call(sub_device, VIDIOC_SUBDEV_S_FMT, &wish) != 0) return false;
  format = {wish.format.code, static_cast<int>(wish.format.width), static_cast<int>(wish.format.height)};
  return true;
}

/// What a pad gives goes along all its links, also those beside our way that cannot be disabled. The kernel starts the
/// stream only if their ends are set up alike. False: one does not take the format.
bool MediaGraph::set_branches(const media_v2_pad& from, const BusFormat& format, std::uint32_t which) noexcept {
  for (const media_v2_link& link : links()) {
    if (!is_data(link) || link.source_id != from.id || (link.flags & MEDIA_LNK_FL_IMMUTABLE) == 0) continue;
    const media_v2_entity* const behind = entity_of_pad(link.sink_id);
    const media_v2_interface* const interface = behind != nullptr ? interface_of(*behind) : nullptr;
    if (interface == nullptr || interface->intf_type != MEDIA_INTF_T_V4L_SUBDEV) continue;
    const int fd = open_sub_device(*interface);
    if (fd < 0) continue;
    BusFormat taken = format;
    const bool is_set = set_pad(fd, *pad(link.sink_id), taken, which);
    system_.close(fd);
    if (!is_set || taken != format) return false;
  }
  return true;
}

DeviceTrouble MediaGraph::set_format(const BusFormat& of_sensor, BusFormat& at_node, std::uint32_t which) noexcept {
  at_node = of_sensor;
  for (std::size_t i = 0; i < steps_; ++i) {
    const Step& step = way_[i];
    const BusFormat given = at_node;
    bool is_set = step.in == nullptr || set_pad(step.fd, *step.in, at_node, which);
    bool is_taken = at_node == given;
    is_set = is_set && set_pad(step.fd, *step.out, at_node, which);
    if (!is_set) {
      DeviceTrouble trouble = device_refusal("VIDIOC_SUBDEV_S_FMT", errno);
      std::snprintf(trouble.found, sizeof(trouble.found), "%.60s", step.entity->name);
      return trouble;
    }
    is_taken = is_taken && set_branches(*step.out, at_node, which);
    if (!is_taken) {
      at_node = {};
      return {};
    }
  }
  return {};
}

std::uint32_t MediaGraph::sensor_code(unsigned index) const noexcept {
  v4l2_subdev_mbus_code_enum code{};
  code.pad = way_[0].out->index;
  code.index = index;
  code.which = V4L2_SUBDEV_FORMAT_ACTIVE;
  return call(way_[0].fd, VIDIOC_SUBDEV_ENUM_MBUS_CODE, &code) == 0 ? code.code : 0;
}

bool MediaGraph::sensor_size(std::uint32_t code, unsigned index, SensorSize& size) const noexcept {
  v4l2_subdev_frame_size_enum listed{};
  listed.pad = way_[0].out->index;
  listed.index = index;
  listed.code = code;
  listed.which = V4L2_SUBDEV_FORMAT_ACTIVE;
  if (call(way_[0].fd, VIDIOC_SUBDEV_ENUM_FRAME_SIZE, &listed) != 0) return false;
  size = {listed.min_width, listed.min_height, listed.max_width, listed.max_height};
  return true;
}

V4l2Controls MediaGraph::sensor_controls() const noexcept {
  V4l2Controls controls(system_);
  controls.add_file(way_[0].fd);
  return controls;
}

bool MediaGraph::control(std::uint32_t id, std::int64_t& value) const noexcept {
  const std::uint32_t type = id == V4L2_CID_PIXEL_RATE ? V4L2_CTRL_TYPE_INTEGER64 : V4L2_CTRL_TYPE_INTEGER;
  return !sensor_controls().read("", {.id = id, .type = type}, value);
}

bool MediaGraph::blanking_rates(unsigned width, unsigned height, double& least_hz, double& most_hz) const noexcept {
  std::int64_t pixel_rate = 0, blank_columns = 0;
  v4l2_query_ext_ctrl blank_rows{};
  blank_rows.id = V4L2_CID_VBLANK;
  if (!control(V4L2_CID_PIXEL_RATE, pixel_rate) || !control(V4L2_CID_HBLANK, blank_columns) ||
      call(way_[0].fd, VIDIOC_QUERY_EXT_CTRL, &blank_rows) != 0)
    return false;
  const double row_hz = static_cast<double>(pixel_rate) / (width + static_cast<double>(blank_columns));
  least_hz = row_hz / (height + static_cast<double>(blank_rows.maximum));
  most_hz = row_hz / (height + static_cast<double>(blank_rows.minimum));
  return true;
}

/// A raw sensor reads out pixel after pixel, blanked ones after each row and after the image; the rows that are blanked
/// can be chosen: rate = pixel rate / ((width + blank) (height + blank)).
double MediaGraph::set_rate(double wanted_hz) noexcept {
  std::int64_t pixel_rate = 0, blank_columns = 0, blank_rows = 0;
  v4l2_subdev_format format{};
  format.which = V4L2_SUBDEV_FORMAT_ACTIVE;
  format.pad = way_[0].out->index;
  if (control(V4L2_CID_PIXEL_RATE, pixel_rate) && control(V4L2_CID_HBLANK, blank_columns) &&
      control(V4L2_CID_VBLANK, blank_rows) && call(way_[0].fd, VIDIOC_SUBDEV_G_FMT, &format) == 0) {
    const double columns = static_cast<double>(format.format.width + blank_columns);
    const double height = format.format.height;
    if (columns <= 0 || pixel_rate <= 0) return 0;
    v4l2_query_ext_ctrl range{};
    range.id = V4L2_CID_VBLANK;
    if (wanted_hz > 0 && call(way_[0].fd, VIDIOC_QUERY_EXT_CTRL, &range) == 0) {
      const double rows = static_cast<double>(pixel_rate) / (columns * wanted_hz);
      const ControlFacts facts{.id = V4L2_CID_VBLANK, .type = V4L2_CTRL_TYPE_INTEGER};
      const ControlValue wish{&facts, "",
                              std::clamp<std::int64_t>(std::llround(rows - height), range.minimum, range.maximum)};
      sensor_controls().write({&wish, 1});
      control(V4L2_CID_VBLANK, blank_rows);
    }
    return static_cast<double>(pixel_rate) / (columns * (height + static_cast<double>(blank_rows)));
  }
  v4l2_subdev_frame_interval interval{};
  interval.pad = way_[0].out->index;
  if (wanted_hz > 0) {
    interval.interval = {1000, static_cast<__u32>(std::lround(1000 * wanted_hz))};
    call(way_[0].fd, VIDIOC_SUBDEV_S_FRAME_INTERVAL, &interval);
  }
  const bool is_told = call(way_[0].fd, VIDIOC_SUBDEV_G_FRAME_INTERVAL, &interval) == 0;
  return is_told && interval.interval.numerator > 0
             ? static_cast<double>(interval.interval.denominator) / interval.interval.numerator
             : 0;
}

}  // namespace epiline
