#pragma once
// The media graph around a video node of a board. Sensor, receiver and the devices between them are sub-devices, which
// must be linked and set to the same format before images flow. No heap, no exceptions.
#include <linux/media.h>
#include <linux/v4l2-subdev.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/sensors/camera/v4l2_controls.h"
#include "platform/error/device_trouble.h"
#include "platform/linux/system_calls.h"

namespace epiline {

/// What a pad of a sub-device gives or takes.
struct BusFormat {
  std::uint32_t code = 0;  ///< MEDIA_BUS_FMT_...
  int width = 0, height = 0;
  bool operator==(const BusFormat&) const = default;
};

/// A size that a sensor gives, or all sizes between two.
struct SensorSize {
  unsigned width = 0, height = 0, width_most = 0, height_most = 0;
};

class MediaGraph {
 public:
  explicit MediaGraph(SystemCalls& system) noexcept : system_(system) {}
  MediaGraph(const MediaGraph&) = delete;
  MediaGraph& operator=(const MediaGraph&) = delete;
  ~MediaGraph() { close(); }

  /// Reads the graph that a video node belongs to, by its device number. False: it belongs to none.
  bool open(std::uint64_t video_node) noexcept;
  void close() noexcept;
  /// The node's name in the graph ("rp1-cfe-csi2_ch0"); empty without one.
  const char* node_name() const noexcept { return node_ != nullptr ? node_->name : ""; }

  /// Finds the way from a sensor to the node and opens the sub-devices on it. `wanted`: part of the sensor's name;
  /// empty where there is only one. No way, or a sensor that cannot be set up (of a USB camera): has_way() is false, no
  /// trouble.
  DeviceTrouble find_way(const char* wanted) noexcept;
  bool has_way() const noexcept { return steps_ > 0; }
  const char* sensor_name() const noexcept { return has_way() ? way_[0].entity->name : ""; }

  /// Enables the links on the way, and disables others that meet its pads.
  DeviceTrouble link() noexcept;
  /// Sets all pads on the way, from the sensor on, each as the one before it gives; what the node then gets: nothing
  /// (code 0) if something on the way does not take what it is given.
  DeviceTrouble set_format(const BusFormat& of_sensor, BusFormat& at_node) noexcept {
    return set_format(of_sensor, at_node, V4L2_SUBDEV_FORMAT_ACTIVE);
  }
  /// Whether the node would get it unchanged. Sets nothing.
  bool passes(const BusFormat& of_sensor) noexcept {
    BusFormat at_node;
    return !set_format(of_sensor, at_node, V4L2_SUBDEV_FORMAT_TRY) && at_node == of_sensor;
  }
  /// Of the sensor; 0: there are no more.
  std::uint32_t sensor_code(unsigned index) const noexcept;
  /// Of the sensor with that code. False: there are no more.
  bool sensor_size(std::uint32_t code, unsigned index, SensorSize& size) const noexcept;
  /// Images per second of that size: the fewest and the most that the sensor's blanking allows as it is now. False: it
  /// cannot be told.
  bool blanking_rates(unsigned width, unsigned height, double& least_hz, double& most_hz) const noexcept;
  /// Sets the sensor's images per second by its blanking, or its interval; then what it is. 0: it cannot be told.
  double set_rate(double wanted_hz) noexcept;

  /// Files of the sub-devices, the sensor first: they have the controls.
  std::size_t sub_devices() const noexcept { return steps_; }
  int sub_device(std::size_t i) const noexcept { return way_[i].fd; }

 private:
  static constexpr std::size_t kMostEntities = 96, kMostInterfaces = 96, kMostPads = 256, kMostLinks = 384,
                               kMostSteps = 8;

  /// An entity on the way, with the pads that the way enters and leaves it by.
  struct Step {
    const media_v2_entity* entity = nullptr;
    const media_v2_pad *in = nullptr, *out = nullptr;
    int fd = -1;
  };

  bool read_topology() noexcept;
  template <class Item, std::size_t N>
  static std::span<const Item> used(const std::array<Item, N>& items, std::uint32_t count) noexcept {
    return {items.data(), count};
  }
  std::span<const media_v2_entity> entities() const noexcept { return used(entities_, topology_.num_entities); }
  std::span<const media_v2_interface> interfaces() const noexcept {
    return used(interfaces_, topology_.num_interfaces);
  }
  std::span<const media_v2_pad> pads() const noexcept { return used(pads_, topology_.num_pads); }
  std::span<const media_v2_link> links() const noexcept { return used(links_, topology_.num_links); }
  const media_v2_entity* entity(std::uint32_t id) const noexcept;
  const media_v2_pad* pad(std::uint32_t id) const noexcept;
  const media_v2_entity* entity_of_pad(std::uint32_t id) const noexcept;
  std::size_t place(const media_v2_entity& of) const noexcept {
    return static_cast<std::size_t>(&of - entities_.data());
  }
  const media_v2_interface* interface_of(const media_v2_entity& entity) const noexcept;
  const media_v2_entity* entity_of_node(std::uint64_t video_node) const noexcept;

  const media_v2_entity* choose_sensor(const char* wanted, DeviceTrouble& trouble) noexcept;
  void search(const media_v2_entity& from) noexcept;
  bool open_way(const media_v2_entity& sensor) noexcept;
  void close_way() noexcept;
  int open_sub_device(const media_v2_interface& interface) noexcept;
  bool set_link(const media_v2_link& link, bool enabled) noexcept;
  /// `which`: V4L2_SUBDEV_FORMAT_ACTIVE or _TRY.
  DeviceTrouble set_format(const BusFormat& of_sensor, BusFormat& at_node, std::uint32_t which) noexcept;
  bool set_pad(int sub_device, const media_v2_pad& pad, BusFormat& format, std::uint32_t which) noexcept;
  bool set_branches(const media_v2_pad& from, const BusFormat& format, std::uint32_t which) noexcept;
  bool control(std::uint32_t id, std::int64_t& value) const noexcept;
  V4l2Controls sensor_controls() const noexcept;
  int call(int fd, unsigned long request, void* argument) const noexcept {
    return call_device(system_, fd, request, argument);
  }

  SystemCalls& system_;
  int fd_ = -1;
  media_v2_topology topology_{};
  std::array<media_v2_entity, kMostEntities> entities_{};
  std::array<media_v2_interface, kMostInterfaces> interfaces_{};
  std::array<media_v2_pad, kMostPads> pads_{};
  std::array<media_v2_link, kMostLinks> links_{};
  const media_v2_entity* node_ = nullptr;
  std::array<std::uint32_t, kMostEntities> link_to_node_{};  ///< per entity: of its way to the node; 0: it has none
  std::array<Step, kMostSteps> way_{};                       ///< the sensor first
  std::size_t steps_ = 0;
};

}  // namespace epiline
