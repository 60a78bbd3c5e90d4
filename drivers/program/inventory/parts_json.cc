#include "drivers/program/inventory/parts_json.h"

namespace epiline {

using OrderedJson = nlohmann::ordered_json;

/// 0 means unknown.
template <class T>
static OrderedJson known(T number) {
  return number > 0 ? OrderedJson(number) : OrderedJson(nullptr);
}

// nlohmann's library finds the following by their arguments, also for lists of them.

static void to_json(OrderedJson& json, const CameraSize& size) {
  json = {{"width", size.width}, {"height", size.height}};
  if (size.is_range()) json.update(OrderedJson{{"width_most", size.width_most}, {"height_most", size.height_most}});
  json["rates_hz"] = size.rates_hz;
  json["any_rate_between"] = size.has_any_rate_between;
}

static void to_json(OrderedJson& json, const CameraFormat& format) {
  json = {{"name", format.name}, {"is_read", format.is_read}, {"is_mosaic", format.is_mosaic}, {"sizes", format.sizes}};
}

static void to_json(OrderedJson& json, const CameraControlRange& c) {
  json = {{"name", c.name}, {"min", c.least}, {"max", c.most}, {"step", c.step}, {"default", c.standard}};
}

static void to_json(OrderedJson& json, const Part& part) {
  json = {{"path", part.path}, {"name", part.name}, {"settings", OrderedJson::object()}, {"trouble", part.trouble}};
  for (const PartSetting& s : part.settings) json["settings"][s.key] = s.value;
}

/// What every part has, and more.
static void add_to(OrderedJson& json, const Part& part, const OrderedJson& more) {
  to_json(json, part);
  json.update(more);
}

static void to_json(OrderedJson& json, const CameraPart& camera) {
  add_to(json, camera,
         {{"bus", camera.bus}, {"driver", camera.driver}, {"formats", camera.formats}, {"controls", camera.controls}});
}

static void to_json(OrderedJson& json, const ImuPart& imu) {
  add_to(json, imu,
         {{"gyroscope", imu.has_gyroscope},
          {"accelerometer", imu.has_accelerometer},
          {"rate_hz", known(imu.rate_hz)},
          {"rates_hz", imu.rates_hz}});
}

static void to_json(OrderedJson& json, const SerialPart& port) {
  add_to(json, port, {{"usb_vendor", port.vendor}, {"usb_product", port.product}, {"autopilot", port.autopilot}});
}

static void to_json(OrderedJson& json, const CanPart& can) {
  add_to(json, can,
         {{"up", can.is_up},
          {"state", can.state},
          {"bitrate", known(can.bitrate)},
          {"data_bitrate", known(can.data_bitrate)},
          {"fd", can.has_fd}});
}

static void to_json(OrderedJson& json, const GpioPart& chip) { add_to(json, chip, {{"lines", known(chip.lines)}}); }

nlohmann::ordered_json to_json(const Parts& parts) {
  return {{"cameras", parts.cameras}, {"imus", parts.imus}, {"spi", parts.spi},
          {"serial", parts.serial},   {"can", parts.can},   {"gpio", parts.gpio}};
}

}  // namespace epiline
