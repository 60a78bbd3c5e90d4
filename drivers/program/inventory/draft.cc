#include "drivers/program/inventory/draft.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "drivers/program/inventory/camera_mode.h"
#include "drivers/program/inventory/config_edit.h"
#include "drivers/program/inventory/probe.h"
#include "pipeline/config/config.h"
#include "pipeline/text/text.h"

namespace epiline {

namespace {

/// A device may call itself anything; a comment is one line of ASCII.
std::string plain(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

std::string named(const Part& part) { return plain(part.path + (part.name.empty() ? "" : " (" + part.name + ")")); }

template <class P>
std::string list_of(const std::vector<P>& parts, const Part* but = nullptr) {
  std::string text;
  for (const P& part : parts)
    if (&part != but) text += (text.empty() ? "" : ", ") + named(part);
  return text.empty() ? "none" : text;
}

/// The entry that selects the part; one that is no plain text cannot be in a configuration, the path is.
std::string selected(const Part& part, const std::string& value) {
  return plain(value) == value && !value.empty() ? value : part.path;
}

/// A setting that has to be filled in, or may be.
constexpr const char* kOpen = "#";

class DraftText {
 public:
  explicit DraftText(const Parts& parts) : parts_(parts) {
    out_.print(
        "# Written by `epiline init` from what was plugged in. Lines that begin with # and a name are to be filled in, "
        "or may be.\n"
        "# `epiline config` prints every setting with its meaning.\n");
  }

  Draft finish() {
    add_camera();
    add_imu();
    add_link();
    add_can();
    draft_.toml = out_;
    return std::move(draft_);
  }

 private:
  void chose(const char* what, const std::string& text) {
    draft_.chosen.push_back(fmt::format("{:9} {}", what, plain(text)));
  }
  void lacks(const char* what, const std::string& text) {
    draft_.missing.push_back(fmt::format("{:9} {}", what, plain(text)));
  }
  void comment(const std::string& text) { out_.print("# {}\n", plain(text)); }
  void set(const char* key, const std::string& value) { out_.print("{} = {}\n", key, toml_text(value)); }
  void open(const char* key, const std::string& value) { out_.print("{}{} = {}\n", kOpen, key, toml_text(value)); }

  void add_camera() {
    out_.print("\n[camera]\n");
    const auto mode = choose_mode(parts_.cameras);
    if (mode) {
      add_mode(*mode);
    } else {
      comment("No camera that epiline can read. Seen: " + list_of(parts_.cameras));
      for (const CameraPart& camera : parts_.cameras) comment(camera.path + ": " + camera.trouble);
      open("device", "/dev/video0");
      out_.print("{0}width = 640\n{0}height = 480\n{0}rate_hz = 30\n", kOpen);
      lacks("camera", "plug one in, or set camera.device");
    }
    comment("Lens, and camera on the IMU: `epiline calibrate` finds them from a recording of a board.");
    open("calibration", "calibration/camera.yaml");
  }

  void add_mode(const CameraMode& mode) {
    const CameraPart& camera = *mode.camera;
    comment(named(camera) + ", the camera that suits best. Others: " + list_of(parts_.cameras, &camera));
    const std::string device =
        selected(camera, camera.lasting_path.empty() ? camera.settings.front().value : camera.lasting_path);
    set("device", device);
    comment(is_grey(*mode.format) ? "A grey format: such sensors mostly have a global shutter."
                                  : "The camera has no grey format in time. If its shutter is rolling, set "
                                    "camera.shutter and camera.readout_ms.");
    if (mode.format->is_mosaic) comment("Four pixels of its colours become one grey one: sizes are half the camera's.");
    if (mode.format->name == "MJPG")
      comment("This size comes in time only as JPEG, whose decoding takes some ms an image.");
    comment("Formats: " + formats_of(camera));
    set("format", mode.format->name);
    comment("Odometry is best with 640x400 to 1280x800 pixels, 20 to 30 times a second. Sizes: " +
            to_text(mode.format->sizes));
    out_.print("width = {}\nheight = {}\n", mode.width, mode.height);
    if (mode.rate_hz > 0) {
      out_.print("rate_hz = {:.6g}\n", std::min(mode.rate_hz, 1000.0));
    } else {
      comment("The driver does not list its rates.");
      out_.print("{}rate_hz = 30\n", kOpen);
    }
    chose("camera", fmt::format("{}: {} {}x{}{}", device, mode.format->name, mode.width, mode.height,
                                mode.rate_hz > 0 ? fmt::format(" at {:.4g} Hz", mode.rate_hz) : ""));
  }

  static std::string formats_of(const CameraPart& camera) {
    std::vector<std::string> names;
    for (const CameraFormat& f : camera.formats) names.push_back(f.name + (f.is_read ? "" : " (not read)"));
    return fmt::format("{}", fmt::join(names, ", "));
  }

  void add_imu() {
    out_.print("\n[imu]\n");
    if (const ImuPart* const chosen = gyroscope()) {
      add_iio(*chosen);
    } else if (const ChipPart* const chip = known_chip()) {
      add_chip(*chip);
    } else if (const SerialPart* const port = controller(); port != nullptr && parts_.spi.empty()) {
      comment("No IMU with a kernel driver, and none on SPI: the samples of the flight controller at " + named(*port));
      set("driver", "mavlink");
      chose("imu", "the flight controller's");
    } else {
      comment("No IMU with a kernel driver. Seen: " + list_of(parts_.imus));
      for (const ImuPart& imu : parts_.imus)
        if (!imu.trouble.empty()) comment(imu.path + ": " + imu.trouble);
      comment(
          "No chip on SPI says that it is an ICM-42688-P or a whole BMI088. Another one is to be named in driver. "
          "SPI: " +
          list_of(parts_.spi));
      comment("driver = \"mavlink\" takes the samples of the flight controller in [mavlink].");
      open("driver", "icm42688p");
      open("device", parts_.spi.empty() ? "/dev/spidev0.0" : parts_.spi.front().path);
      lacks("imu", "set imu.driver and imu.device");
    }
    comment("Noise densities: `epiline calibrate` finds them. Without this file those of EuRoC's IMU are assumed.");
    open("calibration", "calibration/imu.yaml");
  }

  /// The first that epiline has a driver for, with both halves of it there.
  const ChipPart* known_chip() const {
    for (const ChipPart& chip : parts_.spi) {
      if (chip.chip == SpiChip::kIcm42688p) return &chip;
      if (chip.chip == SpiChip::kBmi088Gyroscope && bmi088_accelerometer(parts_) != nullptr) return &chip;
    }
    return nullptr;
  }

  void add_chip(const ChipPart& chip) {
    const bool is_icm = chip.chip == SpiChip::kIcm42688p;
    const std::string name = is_icm ? "an ICM-42688-P" : "a BMI088";
    comment(chip.path + ": " + name + ", by its identity register. SPI: " + list_of(parts_.spi));
    set("driver", driver_of(chip.chip));
    set("device", chip.path);
    if (!is_icm) set("device_accel", bmi088_accelerometer(parts_)->path);
    out_.print("rate_hz = {}\n", usual_rate_hz(chip.chip));
    if (chip.ready_line.empty()) {
      comment(
          "No free line has edges at this rate. Wire the chip's interrupt pin to one: its edges give the best times.");
      open("ready_line", "GPIO25");
      lacks("imu", "imu.ready_line: no free line has the chip's edges");
    } else {
      comment("The one free line with edges at this rate.");
      set("ready_line", chip.ready_line);
    }
    chose("imu", chip.path + ": " + name + (chip.ready_line.empty() ? "" : ", ready line " + chip.ready_line));
  }

  /// One with an accelerometer in it rather than one without.
  const ImuPart* gyroscope() const {
    const ImuPart* const whole = usable_imu(true, true);
    return whole == nullptr && accelerometer() != nullptr ? usable_imu(true, false) : whole;
  }
  const ImuPart* accelerometer() const { return usable_imu(false, true); }
  const ImuPart* usable_imu(bool has_gyroscope, bool has_accelerometer) const {
    for (const ImuPart& imu : parts_.imus)
      if (imu.has_gyroscope == has_gyroscope && imu.has_accelerometer == has_accelerometer && imu.trouble.empty())
        return &imu;
    return nullptr;
  }

  void add_iio(const ImuPart& imu) {
    comment(named(imu) + ", with a kernel driver. Others: " + list_of(parts_.imus, &imu) +
            "; on SPI: " + list_of(parts_.spi));
    set("driver", "iio");
    const std::string device = selected(imu, imu.settings.front().value);
    set("device", device);
    std::string chosen = device;
    if (!imu.has_accelerometer) {
      const std::string accelerometer_device = selected(*accelerometer(), accelerometer()->settings.front().value);
      comment("The accelerometer is a device of its own.");
      set("device_accel", accelerometer_device);
      chosen += " with " + accelerometer_device;
    }
    constexpr double kUsual_hz = 200;
    double rate_hz = kUsual_hz;
    if (!imu.rates_hz.empty()) {
      rate_hz = *std::min_element(imu.rates_hz.begin(), imu.rates_hz.end(), [](double a, double b) {
        return std::abs(std::log(a / kUsual_hz)) < std::abs(std::log(b / kUsual_hz));
      });
      comment(fmt::format("Near 200 Hz. The device has {:.6g} Hz", fmt::join(imu.rates_hz, ", ")));
    } else {
      comment("The driver does not list its rates.");
    }
    out_.print("rate_hz = {:.6g}\n", std::clamp(rate_hz, 1.0, 10000.0));
    chose("imu", fmt::format("{} at {:.4g} Hz", chosen, rate_hz));
  }

  /// The port of a flight controller, if exactly one is plausible: known by its USB identifier, or the only port.
  const SerialPart* controller() const {
    const auto is_known = [](const SerialPart& p) { return !p.autopilot.empty(); };
    const auto known = std::count_if(parts_.serial.begin(), parts_.serial.end(), is_known);
    if (known == 1) return &*std::find_if(parts_.serial.begin(), parts_.serial.end(), is_known);
    return known == 0 && parts_.serial.size() == 1 ? &parts_.serial.front() : nullptr;
  }

  void add_link() {
    out_.print("\n[mavlink]\n");
    const SerialPart* const port = controller();
    if (port == nullptr) {
      comment((parts_.serial.empty() ? "No serial port." : "Not clear which port leads to the flight controller: ") +
              (parts_.serial.empty() ? std::string() : list_of(parts_.serial)));
      open("serial", parts_.serial.empty() ? "/dev/ttyAMA0" : parts_.serial.front().settings.front().value);
      out_.print("{}baud = 921600\n", kOpen);
      return;
    }
    comment(named(*port) + (port->autopilot.empty() ? ", the only serial port" : ": " + port->autopilot) +
            ". Others: " + list_of(parts_.serial, port));
    if (!port->trouble.empty()) comment(port->trouble);
    const std::string device = selected(*port, port->settings.front().value);
    set("serial", device);
    if (port->baud != 0) {
      comment("At this rate its heartbeat was heard.");
      out_.print("baud = {}\n", port->baud);
      if (port->system != 1) out_.print("system = {}\n", port->system);
    } else {
      comment("As the controller's port is set; without meaning on USB.");
      out_.print("baud = 921600\n");
    }
    chose("mavlink", device + (port->autopilot.empty() ? "" : ", " + port->autopilot));
  }

  void add_can() {
    if (parts_.can.empty()) return;
    out_.print("\n[can]\n");
    const CanPart& can = parts_.can.front();
    const bool is_chosen = parts_.can.size() == 1 && controller() == nullptr;
    comment(is_chosen ? "The only bus, and no flight controller on a serial port. Frames with identifiers from 0x300 "
                        "on are sent on it."
                      : "Odometry can be sent on a bus, too: " + list_of(parts_.can));
    if (!can.trouble.empty()) comment(can.path + ": " + can.trouble);
    out_.print("{0}interface = {1}\n{0}fd = {2}\n", is_chosen ? "" : kOpen, toml_text(selected(can, can.path)),
               can.has_fd);
    if (is_chosen) chose("can", can.path);
  }

  const Parts& parts_;
  Text out_;
  Draft draft_;
};

}  // namespace

Result<Draft> draft_configuration(const Parts& parts) {
  if (parts.cameras.empty() && parts.imus.empty() && parts.spi.empty() && parts.serial.empty()) {
    return Error{ErrorKind::kRun, "", 0, "neither a camera nor anything with an IMU is plugged in",
                 "at least one of them; `epiline devices` lists what the kernel sees"};
  }
  return DraftText(parts).finish();
}

Status write_draft(const Draft& draft, const std::filesystem::path& file, bool replaces) {
  if (const auto read = ConfigFile::parse(draft.toml, file.string()); !read) return read.error();
  std::error_code ignored;
  if (!replaces && std::filesystem::exists(file, ignored)) {
    return Error{ErrorKind::kUsage, file.string(), 0, "exists already",
                 "another name in --out, or --force, which keeps the old file as " + file.string() + ".bak"};
  }
  const auto kept = replace_file(file, draft.toml);
  return kept ? Status(Done{}) : Status(kept.error());
}

}  // namespace epiline
