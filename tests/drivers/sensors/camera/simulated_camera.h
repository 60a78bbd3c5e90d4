#pragma once
// A camera played with arithmetic: light of a scene, a sensor's response, a delay of exposure changes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <random>
#include <vector>

#include "drivers/sensors/camera/exposure_controller.h"
#include "drivers/sensors/camera/exposure_timeline.h"

namespace epiline {

/// What falls onto the sensor: blocks of 3x3 pixels of random brightness.
struct PlayedScene {
  static constexpr int kWidth = 80, kHeight = 60;
  std::vector<double> light;  ///< grey value per second of exposure, of a linear sensor

  /// `contrast`: standard deviation of the logarithm; a part of the width is a window, so many times brighter.
  PlayedScene(double level, double contrast, double window_part, double window_times, unsigned seed)
      : light(static_cast<std::size_t>(kWidth) * kHeight) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<double> blocks(static_cast<std::size_t>(kWidth / 3 + 1) * (kHeight / 3 + 1));
    for (double& b : blocks) b = std::exp(contrast * normal(random));
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        const double block = blocks[static_cast<std::size_t>(y / 3 * (kWidth / 3 + 1) + x / 3)];
        light[static_cast<std::size_t>(y * kWidth + x)] = level * block * (x < window_part * kWidth ? window_times : 1);
      }
  }
};

struct PlayedSensor {
  double gamma = 1;    ///< response
  double black = 0;    ///< grey values subtracted: brightness grows faster than light
  int delay = 1;       ///< images stamped after a change that do not show it
  double flicker = 0;  ///< relative amplitude of lamps of 100 Hz
  double rate_hz = 30;
};

inline std::vector<std::uint8_t> picture(const PlayedScene& scene, const PlayedSensor& sensor, double total,
                                         std::mt19937& random) {
  static const std::vector<double> noise = [] {
    std::mt19937 source(1);
    std::normal_distribution<double> normal;
    std::vector<double> values(1 << 14);
    for (double& v : values) v = normal(source);
    return values;
  }();
  constexpr int kSteps = 8;                              // of the response's table, to a grey value
  static std::array<double, 255 * kSteps + 1> response;  // the last sensor's: it costs more than the rest of the image
  static double gamma = 0;
  if (gamma != sensor.gamma)
    for (std::size_t i = 0; i < response.size(); ++i)
      response[i] = 255 * std::pow(static_cast<double>(i) / (255 * kSteps), sensor.gamma);
  gamma = sensor.gamma;
  std::vector<std::uint8_t> pixels(scene.light.size());
  std::size_t n = random();
  for (std::size_t i = 0; i < pixels.size(); ++i, ++n) {
    const double linear = std::clamp(scene.light[i] * total - sensor.black, 0., 255.);
    const double grey = response[static_cast<std::size_t>(linear * kSteps)] + noise[n % noise.size()];
    pixels[i] = static_cast<std::uint8_t>(std::clamp(grey + 0.5, 0., 255.));
  }
  return pixels;
}

/// The sensor, what follows it and what controls it, image by image.
class PlayedCamera {
 public:
  PlayedCamera(const PlayedSensor& sensor, const ExposureLimits& limits, ExposureState start, int configured_delay)
      : sensor_(sensor), controller_(limits), timeline_(configured_delay) {
    timeline_.begin(start);
    told_.push_back({0, start});
  }

  struct Image {
    ExposureState shown, believed;
    bool is_changed = false;  ///< the controller asked for another exposure after it
    ImageStatistics statistics;
    double wanted() const { return wanted_log_factor(statistics, 100); }  ///< logarithm; costs as much as the rest
  };
  /// One image of the scene, made brighter by `light`.
  Image step(const PlayedScene& scene, double light = 1, double turn_rate = 0) {
    const std::uint64_t n = next_++;
    const HostStamp stamp{static_cast<std::int64_t>(static_cast<double>(n + 1) / sensor_.rate_hz * 1e9)};
    // told after image k: k + 1 is the first stamped later
    while (told_.size() > 1 && n >= told_[1].first + static_cast<std::uint64_t>(sensor_.delay)) told_.pop_front();
    Image image;
    image.shown = told_.front().state;
    const double lamps = 1 + sensor_.flicker * std::sin(2 * M_PI * 100 * static_cast<double>(stamp.ns) * 1e-9);
    const auto pixels = picture(scene, sensor_, image.shown.total() * light * lamps, random_);
    const ImageStatistics statistics =
        statistics_of(pixels.data(), PlayedScene::kWidth, PlayedScene::kHeight, PlayedScene::kWidth);
    const auto of_image = timeline_.image(stamp, n);
    timeline_.brightness(statistics.mean);
    image.believed = of_image.state;
    image.statistics = statistics;
    if (const auto next = controller_.step(statistics, of_image, turn_rate)) {
      image.is_changed = true;
      told_.push_back({n + 1, *next});
      timeline_.change(stamp + Span{3'000'000}, *next);  // the image took a while to be read
    }
    return image;
  }
  const ExposureTimeline& timeline() const { return timeline_; }

 private:
  struct Told {
    std::uint64_t first = 0;
    ExposureState state;
  };
  PlayedSensor sensor_;
  ExposureController controller_;
  ExposureTimeline timeline_;
  std::deque<Told> told_;
  std::uint64_t next_ = 0;
  std::mt19937 random_{7};
};

}  // namespace epiline
