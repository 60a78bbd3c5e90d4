#include "drivers/program/check/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>

namespace epiline {

namespace {

Finding found(Grade grade, std::string device, std::string text, std::string remedy = {}) {
  return {grade, std::move(device), std::move(text), std::move(remedy)};
}

bool is_listed(const std::vector<ListedDevice>& devices, const std::string& wanted) {
  return std::any_of(devices.begin(), devices.end(),
                     [&](const ListedDevice& d) { return d.path == wanted || d.name == wanted; });
}

/// A device file, or the name of a listed device.
void check_file(const char* device, const char* key, const std::string& wanted, const std::vector<ListedDevice>& listed,
                Findings& out, bool has_other_names = false) {
  std::string path = wanted;
  if (wanted.empty() || wanted[0] != '/') {
    const auto named = std::find_if(listed.begin(), listed.end(), [&](const auto& d) { return d.name == wanted; });
    if (named != listed.end()) path = named->path;
  }
  if (wanted.empty())
    out.push_back(found(Grade::kError, device, fmt::format("{} is not set", key), "choose one of: " + to_text(listed)));
  else if (path[0] == '/' && !std::filesystem::exists(path))
    out.push_back(found(Grade::kError, device, fmt::format("{} does not exist", wanted),
                        fmt::format("is it plugged in, powered, its driver loaded? Else correct {}; present: {}", key,
                                    to_text(listed))));
  else if (path[0] != '/' && has_other_names && !listed.empty())
    return;  // a bus: opening it will tell
  else if (path[0] != '/')
    out.push_back(found(Grade::kError, device, fmt::format("no device is called \"{}\"", wanted),
                        fmt::format("is it plugged in, powered, its driver loaded? Else correct {}; present: {}", key,
                                    to_text(listed))));
  else if (const auto remedy = permission_remedy(path))
    out.push_back(found(Grade::kError, device, fmt::format("no permission to open {}", path), *remedy));
  else
    out.push_back(found(Grade::kOk, device, fmt::format("{} is present", wanted)));
}

void check_line(const char* device, const std::string& line, const Inventory& inventory, Findings& out) {
  if (line.empty()) return;
  if (inventory.gpio.empty()) {
    out.push_back(found(Grade::kError, device, fmt::format("no GPIO chip for the line {}", line),
                        "load the driver of the pins; gpiodetect lists the chips"));
    return;
  }
  for (const ListedDevice& chip : inventory.gpio)
    if (const auto remedy = permission_remedy(chip.path))
      out.push_back(found(Grade::kWarning, device, fmt::format("no permission to open {}", chip.path), *remedy));
}

void check_interface(const char* device, const char* key, const std::string& interface, const Inventory& inventory,
                     Findings& out) {
  if (interface.empty()) return;
  if (is_listed(inventory.can, interface)) return;  // opening it will tell
  out.push_back(found(Grade::kError, device, fmt::format("no CAN interface {}", interface),
                      fmt::format("is its driver loaded? Else correct {}; present: {}", key, to_text(inventory.can))));
}

std::optional<std::uint64_t> count_of(const DeviceRecord& record, std::string_view name) {
  for (const DeviceCount& c : record.counts)
    if (c.name == name) return c.value;
  return std::nullopt;
}

/// Of the first camera and another: do their images belong together?
void tell_of_pairs(const DeviceRecord& record, Findings& out) {
  const auto pairs = count_of(record, "pairs"), without = count_of(record, "without");
  if (!pairs || !without || *pairs + *without == 0) return;
  const double share = static_cast<double>(*pairs) / static_cast<double>(*pairs + *without);
  const std::string text = fmt::format("{:.0f} % of the first camera's images have one at the same time", 100 * share);
  constexpr double kGood = 0.9;  // the first images have none, as the second camera begins later
  if (share > kGood)
    out.push_back(found(Grade::kOk, record.name, text));
  else
    out.push_back(found(share > 0 ? Grade::kWarning : Grade::kError, record.name, text,
                        "trigger both cameras by one line, set the same rate and exposure for both; their stamps must "
                        "agree within within_ms of its section; or, if nothing triggers them, free_running = true "
                        "(docs/camera.md, Several cameras)"));
}

}  // namespace

Findings check_presence(const DevicesConfig& d, const Inventory& inventory) {
  Findings out;
  check_file("camera", "camera.device", d.camera.device, inventory.cameras, out, true);
  check_line("camera", d.camera.stamp_line, inventory, out);
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    const OtherCameraConfig& other = d.other_cameras[i];
    if (other.device.empty()) continue;
    const std::string key = std::string(kOtherCameraSections[i]) + ".device";
    check_file(kOtherCameraNames[i], key.c_str(), other.device, inventory.cameras, out, true);
    check_line(kOtherCameraNames[i], other.stamp_line, inventory, out);
  }
  switch (static_cast<ImuDriver>(d.imu.driver)) {
    case ImuDriver::kMavlink:
      break;  // comes over the link below
    case ImuDriver::kIio:
      check_file("imu", "imu.device", d.imu.device, inventory.iio, out);
      if (!d.imu.device_accel.empty()) check_file("imu", "imu.device_accel", d.imu.device_accel, inventory.iio, out);
      break;
    default:
      check_file("imu", "imu.device", d.imu.device, inventory.spi, out);
      if (!d.imu.device_accel.empty()) check_file("imu", "imu.device_accel", d.imu.device_accel, inventory.spi, out);
  }
  check_line("imu", d.imu.ready_line, inventory, out);
  if (!d.mavlink.serial.empty()) check_file("mavlink", "mavlink.serial", d.mavlink.serial, inventory.serial, out);
  check_interface("can", "can.interface", d.can.interface, inventory, out);
  check_interface("wheel", "wheel.interface", d.wheel.interface, inventory, out);
  return out;
}

/// Which of several components was taken.
static std::string controller_of(const DeviceRecord& record) {
  const auto component = count_of(record, "controller_component"), type = count_of(record, "controller_type");
  if (!component || !type || *component == 0) return "";
  return fmt::format("; the flight controller is component {}, of type {}", *component, *type);
}

Findings findings_of(const DeviceRecord& record) {
  Findings out;
  std::string text;
  for (const DeviceCount& c : record.counts)
    if (c.is_fault && c.value > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", c.name, c.value);
  if (!text.empty())
    out.push_back(
        found(Grade::kWarning, record.name, "its driver counted faults: " + text,
              "check cables, supply and other load on the bus; the page of the driver in docs explains each count"));
  if (!record.refusal.empty()) out.push_back(found(Grade::kError, record.name, record.refusal, record.remedy));
  for (const DeviceAdvice& a : record.advice)
    out.push_back(found(a.is_error ? Grade::kError : Grade::kWarning, record.name, a.text, a.remedy));
  if (!record.note.empty()) out.push_back(found(Grade::kOk, record.name, record.note));
  tell_of_pairs(record, out);
  if (const auto packets = count_of(record, "packets")) {
    if (*packets == 0)
      out.push_back(found(Grade::kError, record.name, "nothing received from a flight controller",
                          "cross TX and RX, set the same baud rate, switch MAVLink on at that port of the controller; "
                          "over UDP it must send "
                          "from the very ADDRESS:PORT of mavlink.udp: others are not heard"));
    else
      out.push_back(
          found(Grade::kOk, record.name, fmt::format("{} packets received{}", *packets, controller_of(record))));
  }
  if (!record.clock) return out;
  const ClockState& c = *record.clock;
  const std::string clock =
      fmt::format("clock: skew {:+.1f} ppm, residual {:.3f} ms (at most {:.3f} ms), {} jumps", c.skew_ppm,
                  1e3 * c.residual_rms.seconds(), 1e3 * c.residual_most.seconds(), c.jumps);
  switch (c.status) {
    case ClockStatus::kEmpty:
      out.push_back(found(Grade::kWarning, record.name, "clock: the device sent no time",
                          "check that it answers; look longer (--seconds 20)"));
      break;
    case ClockStatus::kUnusable:
      out.push_back(found(Grade::kError, record.name, clock,
                          "it drifts more than any crystal: the driver assumes a wrong tick or a wrong clock"));
      break;
    case ClockStatus::kSettling:
      out.push_back(found(Grade::kWarning, record.name, clock, "not settled yet; look longer (--seconds 20)"));
      break;
    case ClockStatus::kLocked:
      out.push_back(found(c.jumps > 0 ? Grade::kWarning : Grade::kOk, record.name, clock,
                          c.jumps > 0 ? "the device may restart: check its supply" : ""));
  }
  return out;
}

}  // namespace epiline
