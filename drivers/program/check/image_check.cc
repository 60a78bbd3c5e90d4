#include "drivers/program/check/image_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "platform/math/statistics.h"

namespace epiline {

namespace {

constexpr int kHalfEdge = 6;     // px, looked at on both sides of a place
constexpr int kStrongEdge = 40;  // grey values across it
constexpr int kRowStep = 6, kColumnStep = 3;
constexpr std::size_t kFewEdges = 20;

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return quantile(values, 0.5);
}

}  // namespace

double edge_width(const Frame& image) {
  std::vector<double> widths;
  for (int y = kHalfEdge; y < image.height; y += kRowStep) {
    const std::uint8_t* row = image.data + static_cast<std::ptrdiff_t>(y) * image.stride;
    for (int x = kHalfEdge; x + kHalfEdge + 1 < image.width; x += kColumnStep) {
      const int rise = row[x + kHalfEdge] - row[x - kHalfEdge];
      if (std::abs(rise) < kStrongEdge) continue;
      // a single edge: it rises all the way, and is steepest here
      int steepest = 0, back = 0, here = 0;
      for (int k = -kHalfEdge; k < kHalfEdge; ++k) {
        const int step = (row[x + k + 1] - row[x + k]) * (rise > 0 ? 1 : -1);
        back += std::max(0, -step);
        steepest = std::max(steepest, step);
        if (k >= -1 && k <= 0) here = std::max(here, step);
      }
      if (back * 4 > std::abs(rise) || here < steepest) continue;
      widths.push_back(static_cast<double>(std::abs(rise)) / steepest);
    }
  }
  return widths.size() < kFewEdges ? 0 : median_of(std::move(widths));
}

ImageCheck::ImageCheck(const Camera& camera, const TrackerConfig& config) : tracker_(camera, config) {}

const TrackedFrame& ImageCheck::step(const Frame& image) {
  pacing_.step(image.stamp, image.arrival);
  if (images_++ > 0 && image.sequence > last_sequence_) lost_ += image.sequence - last_sequence_ - 1;
  last_sequence_ = image.sequence;
  const ImageStatistics s = statistics_of(image.data, image.width, image.height, image.stride);
  brightness_.push_back(s.mean);
  dark_.push_back(s.dark_share);
  clipped_.push_back(s.clipped_share);
  newest_edge_px_ = edge_width(image);
  if (newest_edge_px_ > 0) widths_.push_back(newest_edge_px_);
  tracker_.step(image, Mat3::Identity(), tracked_);
  features_.push_back(static_cast<double>(tracked_.features.size()));
  return tracked_;
}

ImageResult ImageCheck::result(HostStamp now) const {
  ImageResult r;
  r.pacing = pacing_.result(now);
  r.lost = lost_;
  r.brightness = median_of(brightness_);
  r.dark_share = median_of(dark_);
  r.clipped_share = median_of(clipped_);
  r.edge_width_px = median_of(widths_);
  r.features = median_of(features_);
  const TrackerStats& t = tracker_.stats();
  r.kept_share = t.tried > 0 ? static_cast<double>(t.tracked) / static_cast<double>(t.tried) : 0;
  return r;
}

// ---- in words ----

namespace {

void say_pace(const ImageResult& r, double rate_hz, const DeviceFindings& say) {
  const PacingResult& p = r.pacing;
  say.judge(fmt::format("{:.2f} images per second, jitter {:.2f} ms, age on arrival {:.1f} ms (at most {:.1f} ms)",
                        p.rate_hz(), 1e3 * p.jitter_s, 1e3 * p.delay_s, 1e3 * p.delay_most_s),
            {{p.rate_hz() < 8, Grade::kError,
              "it needs 15 to 60 Hz: shorten the exposure, raise camera.rate_hz, or use a faster bus"},
             {rate_hz > 0 && std::abs(p.rate_hz() / rate_hz - 1) > 0.05, Grade::kWarning,
              fmt::format("{:.4g} are configured; shorten the exposure, or use a faster USB port", rate_hz)},
             {p.jitter_s > 0.1 * p.period_s, Grade::kWarning,
              "timestamps are irregular, as if the driver stamped arrivals; use camera.stamp_line"},
             {p.delay_s < -1e-3, Grade::kWarning,
              "timestamps lie in the future: correct camera.readout_ms or the exposure time"}});
  const std::uint64_t lost = std::max(r.lost, p.missing);
  if (lost + p.backwards == 0) return;
  say.judge(fmt::format("{} of {} images lost, {} with a timestamp not later than the previous one", lost,
                        p.samples + lost, p.backwards),
            {{true, (lost + p.backwards) * 50 > p.samples ? Grade::kError : Grade::kWarning,
              "use another USB port or cable, fewer pixels or a lower rate; move other devices off that hub"}});
}

void say_light(const ImageResult& r, const DeviceFindings& say) {
  say.judge(
      fmt::format("mean brightness {:.0f} of 255, {:.0f} % black, {:.0f} % white", r.brightness, 100 * r.dark_share,
                  100 * r.clipped_share),
      {{r.brightness < 8 || r.dark_share > 0.9, Grade::kError, "remove the lens cap; add light, exposure or gain"},
       {r.brightness < 35 || r.dark_share > 0.5, Grade::kWarning,
        "dark: add light or gain, lengthen the exposure (which blurs), or use exposure.automatic"},
       {r.clipped_share > 0.25, r.clipped_share > 0.7 ? Grade::kError : Grade::kWarning,
        "overexposed: shorten the exposure, lower the gain, or use exposure.automatic"}});
}

void say_sharpness(const ImageResult& r, const DeviceFindings& say) {
  if (r.edge_width_px <= 0)
    return say.warn("no strong edges: sharpness not checked", "point the camera at something with contrast");
  say.judge(fmt::format("edges are {:.1f} px wide", r.edge_width_px),
            {{r.edge_width_px > 6, Grade::kError,
              "out of focus, or a dirty lens: turn the lens until they are 2 to 3 px wide"},
             {r.edge_width_px > 4.2, Grade::kWarning,
              "slightly out of focus: turn the lens until they are 2 to 3 px wide, or shorten the exposure"}});
}

void say_features(const ImageResult& r, int wanted, const DeviceFindings& say) {
  say.judge(fmt::format("{:.0f} of {} corners found, {:.0f} % found again in the next image", r.features, wanted,
                        100 * r.kept_share),
            {{r.features < 15, Grade::kError,
              "nothing to track: check texture, light, focus, and the image size of the calibration"},
             {r.features < 0.4 * wanted || (r.kept_share > 0 && r.kept_share < 0.8), Grade::kWarning,
              "little to track: add light or texture, focus the lens, or use a wider one"}});
}

}  // namespace

Findings findings_of(const ImageResult& r, double rate_hz, int wanted_features) {
  Findings out;
  const DeviceFindings say("camera", out);
  if (r.pacing.samples < 3) {
    say.error(
        fmt::format("{} images", r.pacing.samples),
        "it opened but delivers none: check the external trigger, the media links (docs/camera.md) and the cable");
    return out;
  }
  say_pace(r, rate_hz, say);
  say_silence(r.pacing, say);
  say_light(r, say);
  say_sharpness(r, say);
  say_features(r, wanted_features, say);
  return out;
}

Findings findings_of(const ExposureReport& e, bool is_automatic) {
  Findings out;
  const DeviceFindings say("camera", out);
  const double ms = 1e3 * e.time.seconds();
  if (e.time.ns == 0)
    say.warn("the exposure time is unknown, so timestamps are wrong by half of it",
             "set camera.exposure_control or camera.exposure_ms");
  else
    say.judge(fmt::format("exposure {:.2f} ms, gain {:.2f}{}", ms, e.gain, e.is_automatic ? ", automatic" : ""),
              {{ms > 15, Grade::kWarning, "rotation will blur the images; stay below 10 ms with more light or gain"}});
  if (is_automatic && e.refused > 0)
    say.error(fmt::format("the camera refused {} changes of exposure or gain", e.refused),
              "switch its own automatic exposure off (camera.controls)");
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
  const std::string text =
      reading.is_slow()
          ? fmt::format(
                "images are copied once, because reading the driver's memory takes {:.2f} ms each time, {:.0f} "
                "times as long as ordinary memory",
                in_place_ms, in_place_ms / ordinary_ms)
          : fmt::format("images are read in the driver's memory, {:.2f} ms each time", in_place_ms);
  return {{Grade::kOk, "camera", text, ""}};
}

}  // namespace epiline
