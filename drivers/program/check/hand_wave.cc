#include "drivers/program/check/hand_wave.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "estimator/geometry/so3.h"
#include "estimator/monitor/suspicion.h"
#include "pipeline/text/suspicion_text.h"

namespace epiline {

namespace {
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kLeastTurned_s = 1, kLeastRate = 0.15;  // rad/s
constexpr double kOffset_s = 0.006;                      // worth a remark
constexpr double kWeakestAxis = 0.15;
}  // namespace

void HandWave::add_images(const TrackedFrame& tracked) {
  std::vector<ImuSample> readings;
  {
    const std::lock_guard lock(mutex_);
    readings.swap(readings_);
  }
  for (const ImuSample& r : readings) watch_.add_reading(r);
  watch_.add_images(tracked);
}

void HandWave::add_reading(const ImuSample& reading) {
  const std::lock_guard lock(mutex_);
  readings_.push_back(reading);
}

Findings findings_of(const TurnAgreement& t, const Mat3& R_BC, double time_offset_s) {
  Findings out;
  const DeviceFindings say("camera and imu", out);
  constexpr const char* kWave = "turn the vehicle by hand for some seconds about all three axes, with texture in view";
  if (t.turned_s < kLeastTurned_s || t.rate_rad_s < kLeastRate) {
    say.warn("not turned: time offset and rotation not checked", kWave);
    return out;
  }
  const Suspicions suspicions = suspicions_of(t, R_BC, time_offset_s);
  const auto raised = [&](Suspect s) { return suspicions[static_cast<std::size_t>(s)].severity != Severity::kNone; };
  for (std::size_t i = 0; i < suspicions.size(); ++i) {
    const auto suspect = static_cast<Suspect>(i);
    const bool below =
        suspect == Suspect::kTimeOffset || suspect == Suspect::kRotation || suspect == Suspect::kInverted;
    if (raised(suspect) && !below) say.error(text_of(suspect, suspicions[i]), "");
  }
  if (!out.empty()) return out;
  if (t.agreement < 0.5) {
    say.error(fmt::format("their rotations do not agree ({:.0f} %)", 100 * t.agreement),
              "turn them with things some metres away in view, and move them less; fix them to each other; check the "
              "lens calibration, the gyroscope's scale, and both timestamps");
    return out;
  }
  if (t.agreement < 0.8) {
    say.warn(fmt::format("their rotations agree to {:.0f} % only", 100 * t.agreement),
             "turn more and move less; then check the jitter of the timestamps and the lens calibration");
    return out;
  }
  const bool is_gross = raised(Suspect::kTimeOffset);
  say.judge(fmt::format("time offset {:+.1f} ms (configured {:+.1f})", 1e3 * t.time_offset_s, 1e3 * time_offset_s),
            {{is_gross || std::abs(t.time_offset_s - time_offset_s) > kOffset_s,
              is_gross ? Grade::kError : Grade::kWarning,
              fmt::format("set camera.time_offset_s = {:.4f}{}", t.time_offset_s,
                          is_gross ? ", unless the timestamps of one are wrong" : ""),
              {"camera", "time_offset_s", 1e-4 * std::round(1e4 * t.time_offset_s)}}});
  if (t.weakest_axis < kWeakestAxis) {
    say.warn("turned about too few axes: rotation between them not checked", kWave);
    return out;
  }
  const Severity rotation = suspicions[static_cast<std::size_t>(Suspect::kRotation)].severity;
  say.judge(fmt::format("rotation between them is {:.1f} deg off the configured one",
                        so3_log(R_BC.transpose() * t.R_BC).norm() / kDegree),
            {{rotation == Severity::kGross || raised(Suspect::kInverted), Grade::kError,
              fmt::format("axes are swapped, or T_BS is inverted: the camera looks along ({:+.2f}, {:+.2f}, {:+.2f}) "
                          "in the IMU's axes",
                          t.R_BC(0, 2), t.R_BC(1, 2), t.R_BC(2, 2))},
             {rotation == Severity::kSuspect, Grade::kWarning,
              "calibrate again (docs/calibrate.md), as if something had moved"}});
  return out;
}

}  // namespace epiline
