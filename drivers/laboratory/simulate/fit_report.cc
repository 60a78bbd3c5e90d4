#include "drivers/laboratory/simulate/fit_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <numbers>

namespace epiline {
namespace {

constexpr double kDeg = 180 / std::numbers::pi;

std::string multiple(const Agreement& a) { return fmt::format("{:.2f}", a.rms / a.predicted); }

using Json = nlohmann::ordered_json;
Json json(const Agreement& a) { return {{"rms", a.rms}, {"predicted", a.predicted}}; }
Json json(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

std::string text_of(const FitReport& r) {
  std::string text = fmt::format(
      "fit: {:.1f} s in {:.1f} s and {} steps, knots every {:.1f} ms\n"
      "against the truth: position {:.1f} mm rms, {:.1f} mm p95; rotation {:.2f} deg rms, {:.2f} deg p95; longest gap "
      "{:.2f} s\n"
      "truth to IMU: tilt {:.2f} deg, rotation {:.2f} deg, lever {:.0f} mm, time {:+.1f} ms\n"
      "gyroscope: residual {} of its noise, bias within {:.2g} rad/s; accelerometer: {}, {:.2g} m/s^2\n",
      r.duration_s, r.seconds, r.iterations, 1e3 * r.knot_interval_s, 1e3 * r.position_rms_m, 1e3 * r.position_p95_m,
      kDeg * r.rotation_rms_rad, kDeg * r.rotation_p95_rad, r.longest_gap_s, kDeg * r.tilt_rad,
      kDeg * r.mount_rad.norm(), 1e3 * r.p_BM.norm(), 1e3 * r.time_offset_s, multiple(r.samples.gyroscope),
      r.gyroscope_bias_range, multiple(r.samples.accelerometer), r.accelerometer_bias_range);
  for (const IntegratedAgreement& a : r.integrated) {
    text += fmt::format(
        "IMU integrated over {} s: rotation {:.4f} deg, velocity {:.4f} m/s, position {:.5f} m; {}, {}, {} of what its "
        "noise predicts; NEES {:.2f}\n",
        a.interval_s, kDeg * a.rotation.rms, a.velocity.rms, a.position.rms, multiple(a.rotation), multiple(a.velocity),
        multiple(a.position), a.nees);
  }
  return text;
}

std::string json_of(const FitReport& r) {
  Json integrated = Json::array();
  for (const IntegratedAgreement& a : r.integrated) {
    integrated.push_back({{"interval_s", a.interval_s},
                          {"count", a.count},
                          {"rotation_rad", json(a.rotation)},
                          {"velocity_m_s", json(a.velocity)},
                          {"position_m", json(a.position)},
                          {"nees", a.nees},
                          {"nees_rotation", a.nees_rotation},
                          {"nees_velocity", a.nees_velocity},
                          {"nees_position", a.nees_position}});
  }
  const Json document{{"schema", 1},
                      {"duration_s", r.duration_s},
                      {"knot_interval_s", r.knot_interval_s},
                      {"iterations", r.iterations},
                      {"seconds", r.seconds},
                      {"truth",
                       {{"poses", r.poses},
                        {"longest_gap_s", r.longest_gap_s},
                        {"position_rms_m", r.position_rms_m},
                        {"position_p95_m", r.position_p95_m},
                        {"rotation_rms_rad", r.rotation_rms_rad},
                        {"rotation_p95_rad", r.rotation_p95_rad},
                        {"distrusted_share", r.distrusted_share}}},
                      {"constants",
                       {{"tilt_rad", r.tilt_rad},
                        {"mount_rad", json(r.mount_rad)},
                        {"p_BM_m", json(r.p_BM)},
                        {"time_offset_s", r.time_offset_s}}},
                      {"gyroscope",
                       {{"bias_rad_s", json(r.gyroscope_bias)},
                        {"bias_range_rad_s", r.gyroscope_bias_range},
                        {"residual_rad_s", json(r.samples.gyroscope)},
                        {"residual_p95_rad_s", r.samples.gyroscope_p95}}},
                      {"accelerometer",
                       {{"bias_m_s2", json(r.accelerometer_bias)},
                        {"bias_range_m_s2", r.accelerometer_bias_range},
                        {"residual_m_s2", json(r.samples.accelerometer)},
                        {"residual_p95_m_s2", r.samples.accelerometer_p95}}},
                      {"integrated", integrated}};
  return document.dump(1) + "\n";
}

}  // namespace epiline
