#pragma once
// The media graph of a made-up board, on a FakeKernel: entities, pads, links and sub-devices.
#include <linux/media-bus-format.h>
#include <linux/media.h>
#include <linux/v4l2-controls.h>
#include <linux/v4l2-subdev.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/drivers/fake_kernel.h"

namespace epiline::test {

inline constexpr unsigned kMajor = 81;
inline constexpr std::uint32_t kEnabled = MEDIA_LNK_FL_ENABLED;

class FakeGraph final : public FakeFile {
 public:
  /// Returns its id. `minor`: of its device file; 0: it has none.
  std::uint32_t add_entity(const char* name, std::uint32_t function, unsigned minor) {
    media_v2_entity entity{};
    entity.id = next_id++;
    entity.function = function;
    std::strncpy(entity.name, name, sizeof entity.name - 1);
    entities.push_back(entity);
    if (minor == 0) return entity.id;
    media_v2_interface interface {};
    interface.id = next_id++;
    interface.intf_type = function == MEDIA_ENT_F_IO_V4L ? MEDIA_INTF_T_V4L_VIDEO : MEDIA_INTF_T_V4L_SUBDEV;
    interface.devnode = {kMajor, minor};
    interfaces.push_back(interface);
    links.push_back({next_id++, interface.id, entity.id, MEDIA_LNK_FL_INTERFACE_LINK | MEDIA_LNK_FL_ENABLED, {}});
    return entity.id;
  }
  std::uint32_t add_pad(std::uint32_t entity, std::uint32_t index, bool is_source) {
    const std::uint32_t flags = is_source ? MEDIA_PAD_FL_SOURCE : MEDIA_PAD_FL_SINK;
    pads.push_back({next_id++, entity, flags, index, {}});
    return pads.back().id;
  }
  std::uint32_t add_link(std::uint32_t source, std::uint32_t sink, std::uint32_t flags) {
    links.push_back({next_id++, source, sink, flags, {}});
    return links.back().id;
  }
  bool is_enabled(std::uint32_t id) const {
    for (const media_v2_link& link : links)
      if (link.id == id) return (link.flags & kEnabled) != 0;
    return false;
  }

  int ioctl(unsigned long request, void* argument) override {
    if (request == MEDIA_IOC_G_TOPOLOGY) return give(*static_cast<media_v2_topology*>(argument));
    if (request == MEDIA_IOC_SETUP_LINK) return set(*static_cast<const media_link_desc*>(argument));
    return refuse(ENOTTY);
  }

  std::vector<media_v2_entity> entities;
  std::vector<media_v2_interface> interfaces;
  std::vector<media_v2_pad> pads;
  std::vector<media_v2_link> links;
  std::uint32_t next_id = 1;
  int setup_error = 0;

 private:
  /// Returns how many there are.
  template <class Item>
  static __u32 copy(const std::vector<Item>& items, __u64 into) {
    if (into != 0) std::copy(items.begin(), items.end(), reinterpret_cast<Item*>(into));
    return static_cast<__u32>(items.size());
  }
  int give(media_v2_topology& topology) {
    topology.num_entities = copy(entities, topology.ptr_entities);
    topology.num_interfaces = copy(interfaces, topology.ptr_interfaces);
    topology.num_pads = copy(pads, topology.ptr_pads);
    topology.num_links = copy(links, topology.ptr_links);
    return 0;
  }
  std::uint32_t id_of(const media_pad_desc& wanted) const {
    for (const media_v2_pad& pad : pads)
      if (pad.entity_id == wanted.entity && pad.index == wanted.index) return pad.id;
    return 0;
  }
  int set(const media_link_desc& wish) {
    if (setup_error != 0) return refuse(setup_error);
    for (media_v2_link& link : links) {
      if (link.source_id != id_of(wish.source) || link.sink_id != id_of(wish.sink)) continue;
      if (((link.flags ^ wish.flags) & ~kEnabled) != 0) return refuse(EINVAL);
      if ((link.flags & MEDIA_LNK_FL_IMMUTABLE) != 0 && link.flags != wish.flags) return refuse(EINVAL);
      link.flags = wish.flags;
      return 0;
    }
    return refuse(EINVAL);
  }
};

class FakeSubDevice final : public FakeFile {
 public:
  int ioctl(unsigned long request, void* argument) override {
    switch (request) {
      case VIDIOC_SUBDEV_S_FMT: {
        auto& wish = *static_cast<v4l2_subdev_format*>(argument);
        if (format_error != 0) return refuse(format_error);
        if (most_width != 0) wish.format.width = std::min(wish.format.width, most_width);
        if (!sizes.empty()) set_nearest(wish.format);
        if (wish.which == V4L2_SUBDEV_FORMAT_ACTIVE) width = wish.format.width, height = wish.format.height;
        return 0;
      }
      case VIDIOC_SUBDEV_G_FMT: {
        auto& format = static_cast<v4l2_subdev_format*>(argument)->format;
        format.width = width, format.height = height;
        return 0;
      }
      case VIDIOC_SUBDEV_ENUM_MBUS_CODE: {
        auto& code = *static_cast<v4l2_subdev_mbus_code_enum*>(argument);
        if (code.index >= codes.size()) return refuse(EINVAL);
        code.code = codes[code.index];
        return 0;
      }
      case VIDIOC_SUBDEV_ENUM_FRAME_SIZE: {
        auto& size = *static_cast<v4l2_subdev_frame_size_enum*>(argument);
        if (size.index >= sizes.size() || std::find(codes.begin(), codes.end(), size.code) == codes.end())
          return refuse(EINVAL);
        size.min_width = size.max_width = sizes[size.index].first;
        size.min_height = size.max_height = sizes[size.index].second;
        return 0;
      }
      case VIDIOC_G_EXT_CTRLS:
        return get(*static_cast<v4l2_ext_controls*>(argument)->controls);
      case VIDIOC_S_EXT_CTRLS:
        blank_rows = static_cast<const v4l2_ext_controls*>(argument)->controls->value;
        return 0;
      case VIDIOC_QUERY_EXT_CTRL: {
        auto& range = *static_cast<v4l2_query_ext_ctrl*>(argument);
        if (range.id != V4L2_CID_VBLANK) return refuse(EINVAL);
        range.minimum = 30, range.maximum = 10'000;
        return 0;
      }
      case VIDIOC_SUBDEV_S_FRAME_INTERVAL:
        if (interval.denominator == 0) return refuse(ENOTTY);
        interval = static_cast<const v4l2_subdev_frame_interval*>(argument)->interval;
        return 0;
      case VIDIOC_SUBDEV_G_FRAME_INTERVAL:
        static_cast<v4l2_subdev_frame_interval*>(argument)->interval = interval;
        return interval.denominator != 0 ? 0 : refuse(ENOTTY);
      default:
        return refuse(ENOTTY);
    }
  }

  std::vector<std::uint32_t> codes{MEDIA_BUS_FMT_Y10_1X10, MEDIA_BUS_FMT_Y8_1X8};
  std::uint32_t width = 1456, height = 1088, most_width = 0;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> sizes;  ///< of a sensor; empty: it takes any
  int format_error = 0;
  std::int64_t pixel_rate = 0;  ///< 0: it has no controls
  std::int32_t blank_rows = 30;
  v4l2_fract interval{0, 0};  ///< 0: it has none

 private:
  /// By area, as a sensor's driver takes what it has not.
  void set_nearest(v4l2_mbus_framefmt& format) const {
    const auto off = [&](const auto& size) {
      return std::abs(std::int64_t{size.first} * size.second - std::int64_t{format.width} * format.height);
    };
    const auto nearest =
        *std::min_element(sizes.begin(), sizes.end(), [&](const auto& a, const auto& b) { return off(a) < off(b); });
    format.width = nearest.first, format.height = nearest.second;
  }
  int get(v4l2_ext_control& control) const {
    if (pixel_rate == 0) return refuse(EINVAL);
    if (control.id == V4L2_CID_PIXEL_RATE) return control.value64 = pixel_rate, 0;
    control.value = control.id == V4L2_CID_HBLANK ? 144 : blank_rows;
    return 0;
  }
};

class FakeText final : public FakeFile {
 public:
  explicit FakeText(std::string text) : text_(std::move(text)) {}
  ssize_t read(void* into, std::size_t size) override {
    const std::size_t count = std::min(size, text_.size());
    std::copy_n(text_.begin(), count, static_cast<char*>(into));
    return static_cast<ssize_t>(count);
  }

 private:
  std::string text_;
};

inline void add_sub_device(FakeKernel& kernel, int minor, const std::string& name,
                           const std::shared_ptr<FakeSubDevice>& device) {
  kernel.devices["/sys/dev/char/81:" + std::to_string(minor) + "/uevent"] =
      std::make_shared<FakeText>("MAJOR=81\nMINOR=" + std::to_string(minor) + "\nDEVNAME=" + name + "\n");
  kernel.devices["/dev/" + name] = device;
}

}  // namespace epiline::test
