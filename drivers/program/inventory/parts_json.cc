#include "drivers/program/inventory/parts_json.h"

namespace epiline {

namespace {

using OrderedJson = nlohmann::ordered_json;

/// 0 means unknown.
template <class T>
OrderedJson known(T number) {
  return number > 0 ? OrderedJson(number) : OrderedJson(nullptr);
}

OrderedJson part_json(const Part& part) {
  OrderedJson json;
  json["path"] = part.path;
  json["name"] = part.name;
  json["settings"] = OrderedJson::object();
  for (const PartSetting& s : part.settings) json["settings"][s.key] = s.value;
  json["trouble"] = part.trouble;
  return json;
}

OrderedJson size_json(const CameraSize& size) {
  OrderedJson json{{"width", size.width}, {"height", size.height}};
  if (size.is_range()) json.update(OrderedJson{{"width_most", size.width_most}, {"height_most", size.height_most}});
  json["rates_hz"] = size.rates_hz;
  json["any_rate_between"] = size.has_any_rate_between;
  return json;
}

OrderedJson json_of(const Part& part) { return part_json(part); }

OrderedJson json_of(const CameraPart& camera) {
  OrderedJson json = part_json(camera);
  json["bus"] = camera.bus;
  json["driver"] = camera.driver;
  json["formats"] = OrderedJson::array();
  for (const CameraFormat& format : camera.formats) {
    OrderedJson one{{"name", format.name},
                    {"is_read", format.is_read},
                    {"is_mosaic", format.is_mosaic},
                    {"sizes", OrderedJson::array()}};
    for (const CameraSize& size : format.sizes) one["sizes"].push_back(size_json(size));
    json["formats"].push_back(one);
  }
  json["controls"] = OrderedJson::array();
  for (const CameraControlRange& c : camera.controls)
    json["controls"].push_back(
        {{"name", c.name}, {"min", c.least}, {"max", c.most}, {"step", c.step}, {"default", c.standard}});
  return json;
}

OrderedJson json_of(const ImuPart& imu) {
  OrderedJson json = part_json(imu);
  json["gyroscope"] = imu.has_gyroscope;
  json["accelerometer"] = imu.has_accelerometer;
  json["rate_hz"] = known(imu.rate_hz);
  json["rates_hz"] = imu.rates_hz;
  return json;
}

OrderedJson json_of(const SerialPart& port) {
  OrderedJson json = part_json(port);
  json["usb_vendor"] = port.vendor;
  json["usb_product"] = port.product;
  json["autopilot"] = port.autopilot;
  return json;
}

OrderedJson json_of(const CanPart& can) {
  OrderedJson json = part_json(can);
  json["up"] = can.is_up;
  json["state"] = can.state;
  json["bitrate"] = known(can.bitrate);
  json["data_bitrate"] = known(can.data_bitrate);
  json["fd"] = can.has_fd;
  return json;
}

OrderedJson json_of(const GpioPart& chip) {
  OrderedJson json = part_json(chip);
  json["lines"] = known(chip.lines);
  return json;
}

template <class P>
OrderedJson list_json(const std::vector<P>& parts) {
  OrderedJson list = OrderedJson::array();
  for (const P& part : parts) list.push_back(json_of(part));
  return list;
}

}  // namespace

nlohmann::ordered_json to_json(const Parts& parts) {
  OrderedJson json;
  json["cameras"] = list_json(parts.cameras);
  json["imus"] = list_json(parts.imus);
  json["spi"] = list_json(parts.spi);
  json["serial"] = list_json(parts.serial);
  json["can"] = list_json(parts.can);
  json["gpio"] = list_json(parts.gpio);
  return json;
}

}  // namespace epiline
