// Any graph as the kernel's answer, and any answers of the devices in it: a way is found and set up, or not. Never an
// entity, pad or link beside those that were told, never without end.
#include <linux/media-bus-format.h>
#include <linux/media.h>
#include <sys/ioctl.h>
#include <sys/sysmacros.h>

#include <array>
#include <cerrno>
#include <cstdint>

#include "drivers/sensors/camera/media_graph.h"

using namespace epiline;

namespace {

/// Bytes of the input one after the other; nothing but zeros when they are used up.
class AnyKernel final : public SystemCalls {
 public:
  AnyKernel(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  int open(const char* /*path*/, int /*flags*/) noexcept override {
    return next() % 8 == 7 ? (errno = ENOENT, -1) : 1'000'000;
  }
  int close(int /*fd*/) noexcept override { return 0; }
  ssize_t read(int /*fd*/, void* into, std::size_t size) noexcept override {
    fill(into, size);
    return static_cast<ssize_t>(size);
  }
  std::uint64_t device_number(int /*fd*/) noexcept override { return makedev(81, next() % 4); }
  int ioctl(int /*fd*/, unsigned long request, void* argument) noexcept override {
    if (request == MEDIA_IOC_G_TOPOLOGY) return tell(*static_cast<media_v2_topology*>(argument));
    if (next() % 16 == 15) return errno = EINVAL, -1;
    if (next() % 2 == 1) fill(argument, _IOC_SIZE(request));
    return 0;
  }

 private:
  std::uint8_t next() noexcept { return at_ < size_ ? data_[at_++] : std::uint8_t{0}; }
  void fill(void* into, std::size_t size) noexcept {
    for (std::size_t i = 0; i < size; ++i) static_cast<std::uint8_t*>(into)[i] = next();
  }
  int tell(media_v2_topology& topology) noexcept {
    if (topology.ptr_entities == 0) {
      counts_ = {next() % 100U, next() % 100U, next() % 260U, next() % 390U};
      topology.num_entities = counts_[0];
      topology.num_interfaces = counts_[1];
      topology.num_pads = counts_[2];
      topology.num_links = counts_[3];
      return 0;
    }
    auto* const entities = reinterpret_cast<media_v2_entity*>(topology.ptr_entities);
    for (std::uint32_t i = 0; i < counts_[0]; ++i) {
      entities[i] = {};
      entities[i].id = next() % 32;
      entities[i].name[0] = static_cast<char>(next());  // the kernel ends names
      entities[i].function = next() % 4 == 0 ? MEDIA_ENT_F_CAM_SENSOR : MEDIA_ENT_F_VID_IF_BRIDGE;
    }
    auto* const interfaces = reinterpret_cast<media_v2_interface*>(topology.ptr_interfaces);
    for (std::uint32_t i = 0; i < counts_[1]; ++i) {
      interfaces[i] = {};
      interfaces[i].id = 32U + next() % 32;
      interfaces[i].intf_type = next() % 2 == 0 ? MEDIA_INTF_T_V4L_SUBDEV : MEDIA_INTF_T_V4L_VIDEO;
      interfaces[i].devnode = {81, next() % 4U};
    }
    auto* const pads = reinterpret_cast<media_v2_pad*>(topology.ptr_pads);
    for (std::uint32_t i = 0; i < counts_[2]; ++i)
      pads[i] = {64U + next() % 64,
                 next() % 32U,
                 next() % 2U == 0 ? std::uint32_t{MEDIA_PAD_FL_SINK} : std::uint32_t{MEDIA_PAD_FL_SOURCE},
                 next() % 4U,
                 {}};
    auto* const links = reinterpret_cast<media_v2_link*>(topology.ptr_links);
    for (std::uint32_t i = 0; i < counts_[3]; ++i) {
      const bool is_data = next() % 2 == 0;
      links[i] = {128 + i,
                  is_data ? 64U + next() % 64 : 32U + next() % 32,
                  is_data ? 64U + next() % 64 : next() % 32U,
                  (is_data ? MEDIA_LNK_FL_DATA_LINK : MEDIA_LNK_FL_INTERFACE_LINK) | (next() & 7U),
                  {}};
    }
    return 0;
  }

  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
  std::array<std::uint32_t, 4> counts_{};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  AnyKernel kernel(data, size);
  MediaGraph graph(kernel);
  if (!graph.open(makedev(81, 0))) return 0;
  if (graph.find_way("") || !graph.has_way()) return 0;
  graph.link();
  BusFormat at_node;
  for (unsigned i = 0; i < 4 && graph.sensor_code(i) != 0; ++i)
    graph.set_format({graph.sensor_code(i), 640, 480}, at_node);
  graph.set_rate(30);
  return 0;
}
