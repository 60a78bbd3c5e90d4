#include "drivers/laboratory/render/effects.h"

#include <fmt/format.h>

#include <numbers>

#include "pipeline/text/table.h"

namespace epiline {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180, kStandardGravity = 9.80665;

struct Effect {
  const char* name;
  const char* what;
  double usual, low, high;
  void (*set)(FlightEffects&, double);
};

constexpr Effect kEffects[] = {
    {"blur", "exposure, ms", 6, 0, 100, [](FlightEffects& e, double x) { e.camera.exposure_s = 1e-3 * x; }},
    {"lens-blur", "px", 1.6, 0, 10, [](FlightEffects& e, double x) { e.camera.lens_blur_px = x; }},
    {"vignette", "light lost in the corners, share", 0.35, 0, 1,
     [](FlightEffects& e, double x) { e.camera.vignette = x; }},
    {"noise", "times the usual", 1, 0, 20,
     [](FlightEffects& e, double x) {
       const CameraEffects usual;
       e.camera.read_sigma = x * usual.read_sigma;
       e.camera.shot_factor = x * x * usual.shot_factor;
     }},
    {"auto-exposure", "1: on", 1, 0, 1, [](FlightEffects& e, double x) { e.camera.auto_exposure = x > 0; }},
    {"rolling-shutter", "us per row", 30, -200, 200,
     [](FlightEffects& e, double x) { e.camera.row_time_s = 1e-6 * x; }},
    {"drops", "lost images, share", 0.05, 0, 0.9, [](FlightEffects& e, double x) { e.dropped_share = x; }},
    {"moving", "things that move about", 3, 0, 100, [](FlightEffects& e, double x) { e.movers = static_cast<int>(x); }},
    {"imu-noise", "times the usual, 0: none", 1, 0, 100, [](FlightEffects& e, double x) { e.imu.noise_factor = x; }},
    {"imu-bias", "times the usual, 0: none", 1, 0, 100, [](FlightEffects& e, double x) { e.imu.bias_factor = x; }},
    {"imu-scale", "error of the scales, %", 0.5, 0, 10,
     [](FlightEffects& e, double x) { e.imu.scale_sigma = x / 100; }},
    {"imu-axes", "error of the axes, deg", 0.3, 0, 10,
     [](FlightEffects& e, double x) { e.imu.misalignment_sigma_rad = x * kRadPerDeg; }},
    {"imu-vibration", "Hz", 83, 0.1, 10000, [](FlightEffects& e, double x) { e.imu.vibration_hz = x; }},
    {"imu-rate-limit", "deg/s", 250, 1, 10000,
     [](FlightEffects& e, double x) { e.imu.gyroscope_limit_rad_s = x * kRadPerDeg; }},
    {"imu-force-limit", "g", 2, 0.1, 1000,
     [](FlightEffects& e, double x) { e.imu.accelerometer_limit_m_s2 = x * kStandardGravity; }},
};

Error wrong(std::string_view item, std::string expected) {
  return {ErrorKind::kUsage, "", 0, fmt::format("effect \"{}\"", item), std::move(expected)};
}

Status set_effect(FlightEffects& effects, std::string_view item) {
  const std::size_t equals = item.find('=');
  const std::string_view name = item.substr(0, equals);
  for (const Effect& e : kEffects) {
    if (name != e.name) continue;
    double strength = e.usual;
    if (equals != std::string_view::npos) {
      const bool good = parse_number(item.substr(equals + 1), strength) && strength >= e.low && strength <= e.high;
      if (!good) return wrong(item, fmt::format("{}=NUMBER, {} to {} ({})", e.name, e.low, e.high, e.what));
    }
    e.set(effects, strength);
    return Done{};
  }
  return wrong(item, "one of " + effects_help());
}

}  // namespace

Result<FlightEffects> parse_effects(std::string_view list) {
  FlightEffects effects;
  effects.camera = {.exposure_s = 0,
                    .vignette = 0,
                    .read_sigma = 0,
                    .shot_factor = 0,
                    .row_time_s = 0,
                    .auto_exposure = false,
                    .lens_blur_px = 1};
  if (list == "none") return effects;
  while (true) {
    const std::size_t comma = list.find(',');
    if (const Status s = set_effect(effects, list.substr(0, comma)); !s) return s.error();
    if (comma == std::string_view::npos) return effects;
    list.remove_prefix(comma + 1);
  }
}

std::string effects_help() {
  std::string text;
  for (const Effect& e : kEffects) text += fmt::format("{}[={}] ({}), ", e.name, e.usual, e.what);
  return text + "none";
}

}  // namespace epiline
