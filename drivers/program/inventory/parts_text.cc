#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string_view>

#include "drivers/program/inventory/parts.h"

namespace epiline {

namespace {

/// A device's name may hold anything.
std::string in_quotes(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

std::string rates_text(const std::vector<double>& rates_hz, bool has_any_between) {
  return fmt::format("{:.4g} Hz", fmt::join(rates_hz, has_any_between ? " to " : ", "));
}

void add_line(std::string& out, std::string_view label, std::string_view text) {
  if (!text.empty()) out += fmt::format("          {:9} {}\n", label, text);
}

/// The kind is written once for all parts of it.
void add_part(std::string& out, std::string_view& kind, const Part& part, const std::string& facts) {
  out += fmt::format("{:9} {}{}{}\n", kind, part.path, part.name.empty() ? "" : "  " + part.name,
                     facts.empty() ? "" : "  " + facts);
  kind = "";
  for (const PartSetting& s : part.settings) add_line(out, "setting", s.key + " = " + in_quotes(s.value));
  add_line(out, "trouble", part.trouble);
}

void add(std::string& out, std::string_view& kind, const CameraPart& camera) {
  add_part(out, kind, camera, camera.driver.empty() ? "" : fmt::format("at {}, driver {}", camera.bus, camera.driver));
  std::vector<std::string> others;
  for (const CameraFormat& format : camera.formats) {
    if (!format.is_read) others.push_back(format.name);
    if (!format.is_read) continue;
    add_line(out, format.name, to_text(format.sizes) + (format.is_mosaic ? "; half the camera's, of its colours" : ""));
  }
  add_line(out, "not read", fmt::format("{}", fmt::join(others, ", ")));
  for (const CameraControlRange& c : camera.controls)
    add_line(out, "control", fmt::format("{}  {} to {}, default {}", c.name, c.least, c.most, c.standard));
}

void add(std::string& out, std::string_view& kind, const ImuPart& imu) {
  const bool both = imu.has_gyroscope && imu.has_accelerometer;
  add_part(out, kind, imu, both ? "gyroscope and accelerometer" : imu.has_gyroscope ? "gyroscope" : "accelerometer");
  if (!imu.rates_hz.empty()) add_line(out, "rates", rates_text(imu.rates_hz, false));
  if (imu.rate_hz > 0) add_line(out, "rate now", fmt::format("{:.4g} Hz", imu.rate_hz));
}

void add(std::string& out, std::string_view& kind, const ChipPart& spi) {
  add_part(out, kind, spi, "may be an IMU: set imu.driver to icm42688p, bmi088 or adis16470");
}

void add(std::string& out, std::string_view& kind, const SerialPart& port) {
  const std::string usb = port.vendor.empty() ? "" : fmt::format("(USB {}:{})", port.vendor, port.product);
  add_part(out, kind, port,
           fmt::format("{}{}{}", usb, usb.empty() || port.autopilot.empty() ? "" : " ", port.autopilot));
}

void add(std::string& out, std::string_view& kind, const CanPart& can) {
  std::string facts = fmt::format("{}, {}", can.is_up ? "up" : "down", can.state);
  if (can.bitrate > 0) facts += fmt::format(", {} bit/s", can.bitrate);
  if (can.data_bitrate > 0) facts += fmt::format(", data {} bit/s", can.data_bitrate);
  add_part(out, kind, can, facts + (can.has_fd ? ", FD" : ", no FD (can.fd = false)"));
}

void add(std::string& out, std::string_view& kind, const GpioPart& chip) {
  add_part(out, kind, chip, chip.lines > 0 ? fmt::format("{} lines", chip.lines) : "");
}

template <class P>
void add_all(std::string& out, std::string_view kind, const std::vector<P>& parts) {
  if (parts.empty()) out += fmt::format("{:9} none\n", kind);
  for (const P& part : parts) add(out, kind, part);
}

}  // namespace

std::string to_text(const std::vector<CameraSize>& sizes) {
  std::string text;
  for (const CameraSize& size : sizes) {
    text += fmt::format("{}{}x{}", text.empty() ? "" : ", ", size.width, size.height);
    if (size.is_range()) text += fmt::format(" to {}x{}", size.width_most, size.height_most);
    if (!size.rates_hz.empty()) text += fmt::format(" ({})", rates_text(size.rates_hz, size.has_any_rate_between));
  }
  return text;
}

std::string to_text(const Parts& parts) {
  std::string out;
  add_all(out, "camera", parts.cameras);
  add_all(out, "imu", parts.imus);
  add_all(out, "spi", parts.spi);
  add_all(out, "serial", parts.serial);
  add_all(out, "can", parts.can);
  add_all(out, "gpio", parts.gpio);
  return out;
}

}  // namespace epiline
