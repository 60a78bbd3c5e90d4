#include "drivers/sensors/camera/v4l2_settings.h"

#include <algorithm>

namespace epiline {

namespace {

Error wrong(const char* entry, std::string found, std::string expected) {
  return {ErrorKind::kUsage, entry, 0, std::move(found), std::move(expected)};
}

Span span_of_ms(double ms) { return Span::from_seconds(ms * 1e-3); }

std::string all_formats() {
  std::string names;
  for (int i = 0; i < static_cast<int>(PixelFormat::kCount); ++i)
    names.append(i == 0 ? "" : ", ").append(to_string(static_cast<PixelFormat>(i)));
  return names;
}

/// What two entries say together; each by itself was checked by the table of parameters.
Status check(const CameraConfig& config) {
  const ExposureConfig& exposure = config.exposure;
  if (config.device.empty()) return wrong("camera.device", "no camera", "a path, a name or a bus");
  if (!config.format.empty() && !pixel_format_named(config.format))
    return wrong("camera.format", "\"" + config.format + "\"", all_formats());
  if (config.shutter == static_cast<int>(Shutter::kRolling) && config.readout_ms <= 0)
    return wrong("camera.readout_ms", "0 with a rolling shutter", "the sensor's, from its data sheet");
  for (std::size_t i = 0; i < config.controls.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      if (config.controls[i].name == config.controls[k].name)
        return wrong("camera.controls", "\"" + config.controls[i].name + "\" twice", "each once");
  if (!exposure.automatic) return Done{};
  if (config.exposure_control.empty())
    return wrong("exposure.automatic", "true without camera.exposure_control", "the control that sets the exposure");
  return Done{};
}

}  // namespace

std::vector<PixelFormat> all_by_cost() {
  std::vector<PixelFormat> formats;
  for (int i = 0; i < static_cast<int>(PixelFormat::kCount); ++i) formats.push_back(static_cast<PixelFormat>(i));
  // what need not be copied; then grey before colour, whole images before halved ones, as they are numbered
  std::stable_partition(formats.begin(), formats.end(), is_grey_in_place);
  return formats;
}

Result<V4l2Settings> v4l2_settings_of(const CameraConfig& config) {
  if (const Status status = check(config); !status) return status.error();
  V4l2Settings settings;
  settings.device = config.device;
  settings.sensor = config.sensor;
  settings.width = config.width;
  settings.height = config.height;
  settings.rate_hz = config.rate_hz;
  if (!config.format.empty()) settings.formats = {*pixel_format_named(config.format)};
  settings.controls = config.controls;
  settings.shutter = static_cast<Shutter>(config.shutter);
  settings.readout = span_of_ms(config.readout_ms);
  settings.exposure_control = config.exposure_control;
  settings.exposure = span_of_ms(config.exposure_control.empty() ? config.exposure_ms : config.exposure_unit_ms);
  settings.control_of_exposure = config.exposure;
  if (config.stamp_point != 0) settings.stamp_point = static_cast<StampPoint>(config.stamp_point - 1);
  settings.trust_stamps = config.trust_stamps;
  settings.uses_own_clock = config.clock != 0;
  settings.clock_hz = static_cast<std::uint32_t>(config.clock_hz);
  settings.stamp_line = config.stamp_line;
  settings.stamp_edge = static_cast<Edge>(config.stamp_edge);
  settings.silence_most = span_of_ms(config.silence_ms);
  return settings;
}

}  // namespace epiline
