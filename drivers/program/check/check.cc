#include "drivers/program/check/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>

namespace epiline {

namespace {

/// A device file, or the name of a listed device.
void check_file(const char* device, const std::string& key, const std::string& wanted,
                const std::vector<ListedDevice>& listed, Findings& out, bool has_other_names = false) {
  const DeviceFindings say(device, out);
  if (wanted.empty()) return say.error(key + " is not set", "choose one of: " + to_text(listed));
  const auto named = std::find_if(listed.begin(), listed.end(), [&](const auto& d) { return d.name == wanted; });
  const std::string path = wanted[0] == '/' || named == listed.end() ? wanted : named->path;
  const bool is_path = path[0] == '/';
  if (!is_path && has_other_names && !listed.empty()) return;  // a bus: opening it will tell
  if (!is_path || !std::filesystem::exists(path))
    say.error(is_path ? wanted + " does not exist" : "no device is called \"" + wanted + "\"",
              fmt::format("is it plugged in, powered, its driver loaded? Else correct {}; present: {}", key,
                          to_text(listed)));
  else if (const auto remedy = permission_remedy(path))
    say.error(fmt::format("no permission to open {}", path), *remedy);
  else
    say.ok(fmt::format("{} is present", wanted));
}

void check_line(const char* device, const std::string& line, const Inventory& inventory, Findings& out) {
  const DeviceFindings say(device, out);
  if (line.empty()) return;
  if (inventory.gpio.empty())
    return say.error(fmt::format("no GPIO chip for the line {}", line),
                     "load the driver of the pins; gpiodetect lists the chips");
  for (const ListedDevice& chip : inventory.gpio)
    if (const auto remedy = permission_remedy(chip.path))
      say.warn(fmt::format("no permission to open {}", chip.path), *remedy);
}

void check_interface(const char* device, const std::string& interface, const Inventory& inventory, Findings& out) {
  const auto is_wanted = [&](const ListedDevice& d) { return d.path == interface || d.name == interface; };
  if (interface.empty() || std::any_of(inventory.can.begin(), inventory.can.end(), is_wanted))
    return;  // opening it will tell
  DeviceFindings(device, out)
      .error(
          fmt::format("no CAN interface {}", interface),
          fmt::format("is its driver loaded? Else correct {}.interface; present: {}", device, to_text(inventory.can)));
}

std::optional<std::uint64_t> count_of(const DeviceRecord& record, std::string_view name) {
  for (const DeviceCount& c : record.counts)
    if (c.name == name) return c.value;
  return std::nullopt;
}

/// Of the first camera and another: do their images belong together?
void tell_of_pairs(const DeviceRecord& record, const DeviceFindings& say) {
  const auto pairs = count_of(record, "pairs"), without = count_of(record, "without");
  if (!pairs || !without || *pairs + *without == 0) return;
  const double share = static_cast<double>(*pairs) / static_cast<double>(*pairs + *without);
  constexpr double kGood = 0.9;  // the first images have none, as the second camera begins later
  say.judge(fmt::format("{:.0f} % of the first camera's images have one at the same time", 100 * share),
            {{share <= kGood, share > 0 ? Grade::kWarning : Grade::kError,
              "trigger both cameras by one line, set the same rate and exposure for both; their stamps must agree "
              "within within_ms of its section; or, if nothing triggers them, free_running = true (docs/camera.md, "
              "Several cameras)"}});
}

/// Which of several components was taken.
std::string controller_of(const DeviceRecord& record) {
  const auto component = count_of(record, "controller_component"), type = count_of(record, "controller_type");
  if (!component || !type || *component == 0) return "";
  return fmt::format("; the flight controller is component {}, of type {}", *component, *type);
}

void tell_of_clock(const ClockState& c, const DeviceFindings& say) {
  if (c.status == ClockStatus::kEmpty)
    return say.warn("clock: the device sent no time", "check that it answers; look longer (--seconds 20)");
  say.judge(fmt::format("clock: skew {:+.1f} ppm, residual {:.3f} ms (at most {:.3f} ms), {} jumps", c.skew_ppm,
                        1e3 * c.residual_rms.seconds(), 1e3 * c.residual_most.seconds(), c.jumps),
            {{c.status == ClockStatus::kUnusable, Grade::kError,
              "it drifts more than any crystal: the driver assumes a wrong tick or a wrong clock"},
             {c.status == ClockStatus::kSettling, Grade::kWarning, "not settled yet; look longer (--seconds 20)"},
             {c.jumps > 0, Grade::kWarning, "the device may restart: check its supply"}});
}

}  // namespace

Findings check_presence(const DevicesConfig& d, const Inventory& inventory) {
  Findings out;
  check_file("camera", "camera.device", d.camera.device, inventory.cameras, out, true);
  check_line("camera", d.camera.stamp_line, inventory, out);
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    const OtherCameraConfig& other = d.other_cameras[i];
    if (other.device.empty()) continue;
    check_file(kOtherCameraNames[i], std::string(kOtherCameraSections[i]) + ".device", other.device, inventory.cameras,
               out, true);
    check_line(kOtherCameraNames[i], other.stamp_line, inventory, out);
  }
  const auto driver = static_cast<ImuDriver>(d.imu.driver);
  if (driver != ImuDriver::kMavlink) {  // which comes over the link below
    const auto& listed = driver == ImuDriver::kIio ? inventory.iio : inventory.spi;
    check_file("imu", "imu.device", d.imu.device, listed, out);
    if (!d.imu.device_accel.empty()) check_file("imu", "imu.device_accel", d.imu.device_accel, listed, out);
  }
  check_line("imu", d.imu.ready_line, inventory, out);
  if (!d.mavlink.serial.empty()) check_file("mavlink", "mavlink.serial", d.mavlink.serial, inventory.serial, out);
  check_interface("can", d.can.interface, inventory, out);
  check_interface("wheel", d.wheel.interface, inventory, out);
  return out;
}

Findings findings_of(const DeviceRecord& record) {
  Findings out;
  const DeviceFindings say(record.name, out);
  std::string text;
  for (const DeviceCount& c : record.counts)
    if (c.is_fault && c.value > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", c.name, c.value);
  if (!text.empty())
    say.warn("its driver counted faults: " + text,
             "check cables, supply and other load on the bus; the page of the driver in docs explains each count");
  if (!record.refusal.empty()) say.error(record.refusal, record.remedy);
  for (const DeviceAdvice& a : record.advice)
    say.judge(a.text, {{true, a.is_error ? Grade::kError : Grade::kWarning, a.remedy}});
  if (!record.note.empty()) say.ok(record.note);
  tell_of_pairs(record, say);
  if (const auto packets = count_of(record, "packets")) {
    if (*packets == 0)
      say.error("nothing received from a flight controller",
                "cross TX and RX, set the same baud rate, switch MAVLink on at that port of the controller; over UDP "
                "it must send from the very ADDRESS:PORT of mavlink.udp: others are not heard");
    else
      say.ok(fmt::format("{} packets received{}", *packets, controller_of(record)));
  }
  if (record.clock) tell_of_clock(*record.clock, say);
  return out;
}

}  // namespace epiline
