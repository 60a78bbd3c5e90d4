#include <algorithm>

#include "drivers/program/inventory/find.h"
#include "drivers/sensors/camera/media_graph.h"
#include "drivers/sensors/camera/v4l2_lists.h"

namespace epiline {

namespace {

template <std::size_t N>
std::string text_of(const __u8 (&field)[N]) {
  return {field, std::find(field, field + N, 0)};
}

void add_rates(const V4l2Device& device, std::uint32_t fourcc, CameraSize& size) {
  each_rate(device, fourcc, size.width, size.height, [&](const v4l2_frmivalenum& rate) {
    size.has_any_rate_between = rate.type != V4L2_FRMIVAL_TYPE_DISCRETE;
    if (size.has_any_rate_between)
      size.rates_hz = {rate_hz_of(rate.stepwise.max), rate_hz_of(rate.stepwise.min)};
    else
      size.rates_hz.push_back(rate_hz_of(rate.discrete));
  });
}

std::vector<CameraSize> sizes_of(const V4l2Device& device, std::uint32_t fourcc) {
  std::vector<CameraSize> sizes;
  each_size(device, fourcc, [&](const v4l2_frmsizeenum& one) {
    CameraSize size{one.discrete.width, one.discrete.height, one.discrete.width, one.discrete.height, {}, false};
    if (one.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
      const v4l2_frmsize_stepwise& range = one.stepwise;
      size = {range.min_width, range.min_height, range.max_width, range.max_height, {}, false};
    }
    add_rates(device, fourcc, size);
    sizes.push_back(std::move(size));
  });
  return sizes;
}

/// Empty: the sensor of a board's camera does not give what the receiver writes in that format.
std::vector<CameraSize> sizes_of_sensor(MediaGraph& graph, const std::string& format) {
  std::vector<CameraSize> sizes;
  const auto known = pixel_format_named(format);
  const std::uint32_t wanted = known && graph.has_way() ? bus_code_of(*known) : 0;
  bool is_given = false;
  for (unsigned i = 0; wanted != 0 && i < kMostListed && !is_given; ++i) is_given = graph.sensor_code(i) == wanted;
  SensorSize one;
  for (unsigned i = 0; is_given && i < kMostListed && graph.sensor_size(wanted, i, one); ++i) {
    if (!graph.passes({wanted, static_cast<int>(one.width_most), static_cast<int>(one.height_most)})) continue;
    CameraSize size{one.width, one.height, one.width_most, one.height_most, {}, false};
    double least_hz = 0, most_hz = 0;
    size.has_any_rate_between = graph.blanking_rates(size.width_most, size.height_most, least_hz, most_hz);
    if (size.has_any_rate_between) size.rates_hz = {least_hz, most_hz};
    sizes.push_back(std::move(size));
  }
  return sizes;
}

/// The receiver of a board's camera lists all that it could pass on, in any size. What the sensor gives of that is
/// listed alone, unless a part between the two has to make something else of it.
std::vector<CameraFormat> formats_of(const V4l2Device& device, MediaGraph& graph) {
  std::vector<CameraFormat> formats, of_sensor;
  each_format(device, [&](const v4l2_fmtdesc& listed) {
    const std::uint32_t fourcc = listed.pixelformat;
    char name[5];
    write_fourcc(fourcc, name);
    CameraFormat format{name, is_read(fourcc), is_mosaic(fourcc), {}};
    while (!format.name.empty() && format.name.back() == ' ') format.name.pop_back();  // "Y10 "
    format.sizes = sizes_of_sensor(graph, format.name);
    const bool is_given = !format.sizes.empty();
    if (!is_given) format.sizes = sizes_of(device, fourcc);
    for (CameraSize& size : format.sizes)
      for (unsigned* side : {&size.width, &size.height, &size.width_most, &size.height_most})
        *side /= format.is_mosaic ? 2 : 1;
    (is_given ? of_sensor : formats).push_back(std::move(format));
  });
  return of_sensor.empty() ? formats : of_sensor;
}

std::vector<CameraControlRange> controls_of(const V4l2Controls& files) {
  std::vector<CameraControlRange> controls;
  each_control(files, [&](const v4l2_query_ext_ctrl& query, std::size_t /*file*/) {
    char name[2 * sizeof(query.name)];
    write_control_name(query.name, name);
    CameraControlRange control{name, query.minimum, query.maximum, static_cast<std::int64_t>(query.step),
                               query.default_value};
    const bool is_one = control.name.find("exposure") != std::string::npos ||  //
                        control.name.find("gain") != std::string::npos;
    if (is_one && query.type != V4L2_CTRL_TYPE_CTRL_CLASS) controls.push_back(std::move(control));
    return controls.size() < kMostListed;
  });
  return controls;
}

}  // namespace

std::optional<CameraPart> find_camera(const std::filesystem::path& root, const ListedDevice& listed,
                                      SystemCalls& system) {
  auto part = part_of<CameraPart>(root, listed);
  const std::filesystem::path file_name = std::filesystem::path(listed.path).filename();
  for (const char* folder : {"dev/v4l/by-id", "dev/v4l/by-path"})
    if (part.lasting_path.empty()) part.lasting_path = lasting_name(root, folder, file_name);
  if (!part.trouble.empty()) return part;
  V4l2Device device(system);
  if (const DeviceTrouble trouble = device.open(below(root, listed.path).c_str(), "")) {
    if (trouble.error == 0) return std::nullopt;
    part.trouble = error_of(trouble, part.path).text();
    return part;
  }
  v4l2_capability capability{};
  device.call(VIDIOC_QUERYCAP, &capability);
  part.name = text_of(capability.card);
  part.bus = text_of(capability.bus_info);
  part.driver = text_of(capability.driver);
  MediaGraph graph(system);
  if (graph.open(system.device_number(device.fd()))) {
    const DeviceTrouble trouble = graph.find_way("");
    if (trouble) part.trouble = error_of(trouble, part.path).text();
    if (graph.has_way()) part.name = graph.node_name();  // a receiver's nodes share card and bus
  }
  V4l2Controls controls(system);
  controls.add_file(device.fd());
  for (std::size_t i = 0; i < graph.sub_devices(); ++i) controls.add_file(graph.sub_device(i));
  part.formats = formats_of(device, graph);
  part.controls = controls_of(controls);
  if (part.trouble.empty() &&
      std::none_of(part.formats.begin(), part.formats.end(), [](const CameraFormat& f) { return f.is_read; }))
    part.trouble = "epiline reads none of its formats; docs/camera.md lists those it reads";
  return part;
}

}  // namespace epiline
