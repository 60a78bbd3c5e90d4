#include "pipeline/text/suspicion_text.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <numbers>

#include "platform/log/suspicion_names.h"

namespace epiline {

namespace {

static_assert(std::size(kSuspectNames) == static_cast<std::size_t>(Suspect::kCount));
static_assert(std::size(kSeverityNames) == static_cast<std::size_t>(Severity::kGross) + 1);

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::int8_t kAxisShift = 4;  // -3 to 3 become digits

/// Which axes of the sensor are wrong: "x and y are swapped", "z has the wrong sign".
std::string axes_text(const TurnedAxes& axes) {
  constexpr std::array kNames = {"x", "y", "z"};
  std::string flipped, moved;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto to = static_cast<std::size_t>(std::abs(axes[k]));
    if (to != k + 1) {
      moved += (moved.empty() ? "" : " and ") + std::string(kNames[k]);
    } else if (axes[k] < 0) {
      flipped += (flipped.empty() ? "" : ", ") + std::string(kNames[k]);
    }
  }
  if (!moved.empty()) return fmt::format("its axes {} look swapped", moved);
  if (flipped == "x, y, z") return "the image looks mirrored, or all its signs are wrong";
  return fmt::format("the sign of its {} axis looks wrong", flipped);
}

std::string wheel_scale_text(double figure) {
  if (figure < 0)
    return "the wheels read backwards: the sign of the scale in wheel.signal, or camera and IMU look back";
  if (figure < 0.8 || figure > 1.25)
    return fmt::format("the vehicle goes {:.2g} times as fast as its wheels read: {}", figure,
                       figure > 0.26 && figure < 0.3 ? "in km/h?" : "wrong unit or scale (wheel.signal)?");
  return fmt::format("the wheels read {:.1f} % too {}: they slip, or the scale in wheel.signal is wrong",
                     100 * std::abs(1 / figure - 1), figure < 1 ? "much" : "little");
}

std::string found(Suspect suspect, const Suspicion& s) {
  switch (suspect) {
    case Suspect::kRotation:
      return fmt::format(
          "the camera's rotation disagrees with the gyroscope by {:.0f} degrees: T_BS of the camera (or the mounting) "
          "is wrong",
          s.figure / kDegree);
    case Suspect::kInverted:
      return "the inverse of the camera's rotation would agree with the gyroscope: T_BS (T_cam_imu) is inverted";
    case Suspect::kPlace:
      return fmt::format("the camera is {:.0f} cm from where T_BS puts it on the IMU", 100 * s.figure);
    case Suspect::kMirrored:
      return fmt::format("gyroscope and camera turn as in a mirror: {}", axes_text(s.axes));
    case Suspect::kTimeOffset:
      return fmt::format("image timestamps are {} by {:.0f} ms: set camera.time_offset_s, or mend the timestamps",
                         s.figure > 0 ? "early" : "late", 1e3 * std::abs(s.figure));
    case Suspect::kGyroscopeUnits:
      if (s.figure < 0) return fmt::format("the gyroscope's rates average {:.0f} rad/s: in degrees?", -s.figure);
      return fmt::format("the gyroscope's rates are {:.2g} times those of the camera: {}", s.figure,
                         s.figure > 20 && s.figure < 160 ? "in degrees instead of radians?" : "wrong units?");
    case Suspect::kScale:
      return fmt::format(
          "the gyroscope's rates are {:.2f} times those of the camera: focal length (or image size) or the gyroscope's "
          "scale is wrong",
          s.figure);
    case Suspect::kUnrelated:
      return "camera and gyroscope do not turn together: not fixed to each other, wrong axes or timestamps, or not of "
             "one flight";
    case Suspect::kAccelerometerUnits:
      return fmt::format("accelerometer readings average {:.1f} m/s^2 instead of 9.8: {}", s.figure,
                         s.figure > 0.8 && s.figure < 1.25 ? "in g?" : "wrong units or scale?");
    case Suspect::kMisfit:
      return fmt::format(
          "images and IMU contradict each other by {:.1f} px: lens calibration (distortion), mounting, timestamps, or "
          "axes of the accelerometer",
          s.figure);
    case Suspect::kImuMisfit:
      return "the images contradict the IMU by more than its noise: an axis or sign of the accelerometer, mounting, "
             "timestamps, or noise densities that are too small";
    case Suspect::kBehind:
      return fmt::format(
          "the camera travels the other way than the IMU says: {:.0f} % of the tracks meet behind it (a sign of the "
          "accelerometer, or the mounting)",
          100 * s.figure);
    case Suspect::kGyroscopeNoise:
    case Suspect::kAccelerometerNoise:
      return fmt::format("the {} readings scatter {} the configured noise density allows: it is off by {:.2g}",
                         suspect == Suspect::kGyroscopeNoise ? "gyroscope's" : "accelerometer's",
                         s.figure > 1 ? "more than" : "less than", s.figure > 1 ? s.figure : 1 / s.figure);
    case Suspect::kFocalLength:
      return fmt::format("the focal length is {:.1f} % {} than configured", 100 * std::abs(s.figure - 1),
                         s.figure > 1 ? "longer" : "shorter");
    case Suspect::kLensShape:
      return fmt::format("45 degrees off its axis the lens draws {:.1f} % {} than configured: its distortion is wrong",
                         100 * std::abs(s.figure - 1), s.figure > 1 ? "farther out" : "nearer in");
    case Suspect::kAccelerometerScale:
    case Suspect::kGyroscopeScale:
      return fmt::format("the {} readings are {:.1f} % too {}: its scale is wrong",
                         suspect == Suspect::kGyroscopeScale ? "gyroscope's" : "accelerometer's",
                         100 * std::abs(1 / s.figure - 1), s.figure < 1 ? "large" : "small");
    case Suspect::kWheelScale:
      return wheel_scale_text(s.figure);
    case Suspect::kWheelSlip:
      return fmt::format(
          "the wheels' speeds scatter about the vehicle's by {:.0f} %: they slip, or are not this vehicle's",
          100 * s.figure);
    case Suspect::kWheelStuck:
      return fmt::format("the wheels read {:.2f} m/s while the vehicle's speed changes: stuck, or an old message",
                         s.figure);
    case Suspect::kWheelDelay:
      return fmt::format("the wheels' speeds are late by {:.2f} s: set wheel.delay_ms, or mend the timestamps",
                         s.figure);
    case Suspect::kCount:
      break;
  }
  return "unknown";
}

}  // namespace

const char* to_string(Suspect suspect) noexcept { return kSuspectNames[static_cast<std::size_t>(suspect)]; }
const char* to_string(Severity severity) noexcept { return kSeverityNames[static_cast<std::size_t>(severity)]; }

std::string text_of(Suspect suspect, const Suspicion& s) {
  return found(suspect, s) + (s.severity == Severity::kNote ? " (the flight corrects for it)" : "");
}

Event event_of(HostStamp stamp, Suspect suspect, const Suspicion& s) noexcept {
  std::int64_t figure = std::llround(1e6 * s.figure);
  if (suspect == Suspect::kMirrored) {
    figure = 0;
    for (const std::int8_t axis : s.axes) figure = 10 * figure + axis + kAxisShift;
  }
  return make_event(stamp, EventId::kNumberWrong, suspect, s.severity, figure);
}

std::string text_of(const Event& event) {
  const auto suspect = static_cast<Suspect>(event.args[0]);
  Suspicion s{static_cast<Severity>(event.args[1]), 1e-6 * static_cast<double>(event.args[2]), {}};
  if (suspect == Suspect::kMirrored) {
    std::int64_t packed = event.args[2];
    for (std::size_t k = 3; k-- > 0; packed /= 10) s.axes[k] = static_cast<std::int8_t>(packed % 10 - kAxisShift);
  }
  return text_of(suspect, s);
}

std::vector<std::string> texts_of(const Suspicions& suspicions) {
  std::vector<std::string> texts;
  for (const Severity severity : {Severity::kGross, Severity::kSuspect, Severity::kNote})
    for (std::size_t i = 0; i < suspicions.size(); ++i)
      if (suspicions[i].severity == severity) texts.push_back(text_of(static_cast<Suspect>(i), suspicions[i]));
  return texts;
}

}  // namespace epiline
