#include "drivers/program/inventory/camera_mode.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <tuple>

namespace epiline {

namespace {

constexpr double kLeastRate_hz = 20, kMostRate_hz = 30;
constexpr double kUsualPixels = 640.0 * 480.0, kFewestPixels = 640.0 * 400.0, kMostPixels = 1280.0 * 800.0;

/// The highest up to 30 Hz that is 20 Hz or more, else the lowest above, else the highest below.
double choose_rate(const CameraSize& size) {
  if (size.rates_hz.empty()) return 0;
  const auto [least, most] = std::minmax_element(size.rates_hz.begin(), size.rates_hz.end());
  if (size.has_any_rate_between) return std::clamp(kMostRate_hz, *least, *most);
  const auto badness = [](double hz) {
    constexpr double kSlack_hz = 0.5;  // 30.02 Hz is 30 Hz
    if (hz > kMostRate_hz + kSlack_hz) return std::pair(1, hz);
    return std::pair(hz >= kLeastRate_hz - kSlack_hz ? 0 : 2, -hz);
  };
  return *std::min_element(size.rates_hz.begin(), size.rates_hz.end(),
                           [&](double a, double b) { return badness(a) < badness(b); });
}

/// Larger is better.
auto merit(const CameraMode& mode) {
  const double pixels = static_cast<double>(mode.width) * mode.height;
  const bool fast = mode.rate_hz == 0 || mode.rate_hz >= kLeastRate_hz - 0.5;
  const bool sized = pixels >= kFewestPixels && pixels <= kMostPixels;
  const bool calm = mode.rate_hz <= kMostRate_hz + 0.5;
  const bool is_cheap = mode.format->name != "MJPG";
  return std::tuple(fast, is_grey(*mode.format), is_cheap, sized, calm, -std::abs(std::log(pixels / kUsualPixels)));
}

}  // namespace

bool is_grey(const CameraFormat& format) {
  constexpr std::array<std::string_view, 6> kGreyFormats{"GREY", "Y10P", "Y12P", "Y10", "Y12", "Y16"};
  return std::find(kGreyFormats.begin(), kGreyFormats.end(), format.name) != kGreyFormats.end();
}

std::optional<CameraMode> choose_mode(const std::vector<CameraPart>& cameras) {
  std::optional<CameraMode> best;
  for (const CameraPart& camera : cameras) {
    if (!camera.trouble.empty()) continue;
    for (const CameraFormat& format : camera.formats) {
      if (!format.is_read) continue;
      for (const CameraSize& size : format.sizes) {
        if (size.width_most == 0 || size.height_most == 0) continue;
        const CameraMode mode{&camera, &format, std::clamp(640u, size.width, size.width_most),
                              std::clamp(480u, size.height, size.height_most), choose_rate(size)};
        if (!best || merit(mode) > merit(*best)) best = mode;
      }
    }
  }
  return best;
}

}  // namespace epiline
