#include "drivers/program/check/camera_findings.h"

#include <fmt/format.h>

namespace epiline {

Findings findings_of(const ExposureReport& e, bool is_automatic) {
  Findings out;
  const double ms = 1e3 * e.time.seconds();
  const std::string text =
      fmt::format("exposure {:.2f} ms, gain {:.2f}{}", ms, e.gain, e.is_automatic ? ", automatic" : "");
  if (e.time.ns == 0)
    out.push_back({Grade::kWarning, "camera", "the exposure time is unknown, so timestamps are wrong by half of it",
                   "set camera.exposure_control or camera.exposure_ms"});
  else if (ms > 15)
    out.push_back(
        {Grade::kWarning, "camera", text, "rotation will blur the images; stay below 10 ms with more light or gain"});
  else
    out.push_back({Grade::kOk, "camera", text, ""});
  if (is_automatic && e.refused > 0)
    out.push_back({Grade::kError, "camera", fmt::format("the camera refused {} changes of exposure or gain", e.refused),
                   "switch its own automatic exposure off (camera.controls)"});
  return out;
}

Finding finding_of_stamps(const CameraConfig& config) {
  const char* const text = !config.stamp_line.empty() ? "timestamps are those of the edges of camera.stamp_line"
                           : config.clock != 0        ? "timestamps are by the camera's own clock"
                                                      : "timestamps are the V4L2 driver's";
  return {Grade::kOk, "camera", text, ""};
}

Findings findings_of(Focus focus) {
  if (focus == Focus::kUnknown) return {};
  if (focus == Focus::kHeld) return {{Grade::kOk, "camera", "its autofocus is off: the lens stays as it is", ""}};
  return {{Grade::kError, "camera", "its autofocus is on: a lens that refocuses no longer fits its calibration",
           "leave focus_automatic_continuous out of camera.controls, set focus_absolute there, and calibrate with it"}};
}

Findings findings_of(const BufferReading& reading) {
  if (reading.ordinary.ns == 0) return {};
  const double in_place_ms = 1e3 * reading.in_place.seconds(), ordinary_ms = 1e3 * reading.ordinary.seconds();
  if (!reading.is_slow())
    return {{Grade::kOk, "camera",
             fmt::format("images are read in the driver's memory, {:.2f} ms each time", in_place_ms), ""}};
  return {{Grade::kOk, "camera",
           fmt::format("images are copied once, because reading the driver's memory takes {:.2f} ms each time, {:.0f} "
                       "times as long as ordinary memory",
                       in_place_ms, in_place_ms / ordinary_ms),
           ""}};
}

}  // namespace epiline
