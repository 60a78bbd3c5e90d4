#include "drivers/sensors/camera/exposure_controller.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {

// ---- how much there is to track, at other exposures ----

constexpr int kReach = 8, kPerOctave = 4;  // exposures looked at: a quarter to four times, in quarters of an octave
constexpr std::size_t kFactors = 2 * kReach + 1;
constexpr double kNoise = 3, kHalfWorth = 10;  // grey values: no edge; an edge well seen
constexpr double kMeanWeight = 0.03;           // of the mean's distance (logarithm, squared) against an edge's worth
constexpr double kLightTail = 1;               // octaves over which clipped light is thought to spread
constexpr double kClippedCost = 0.3;           // a clipped place spoils the patches around it

double log2_factor(std::size_t i) noexcept { return (static_cast<double>(i) - kReach) / kPerOctave; }

using Worths = std::array<std::array<double, kFactors>, ImageStatistics::kSlopes>;

/// Of an edge, by its slope bin and the factor.
const Worths& worths() noexcept {
  static const Worths table = [] {
    Worths worth{};
    for (std::size_t slope = 0; slope < ImageStatistics::kSlopes; ++slope)
      for (std::size_t i = 0; i < kFactors; ++i) {
        const double height = (static_cast<double>(slope) + 0.5) * ImageStatistics::kSlopeWidth;
        worth[slope][i] = std::log1p(std::max(0., height * std::exp2(log2_factor(i)) - kNoise) / kHalfWorth);
      }
    return worth;
  }();
  return table;
}

/// The share of a bin's places that are not clipped when the light is multiplied.
double share_left(std::size_t level, double factor) noexcept {
  const double begin = static_cast<double>(level) * ImageStatistics::kLevelWidth;
  return std::clamp((ImageStatistics::kClipped / factor - begin) / ImageStatistics::kLevelWidth, 0., 1.);
}

double information(const ImageStatistics& image, std::size_t i) noexcept {
  const double factor = std::exp2(log2_factor(i));
  double seen = 0, places = 0;
  for (std::size_t level = 0; level < ImageStatistics::kLevels; ++level) {
    // what is clipped already stays so, unless the light is less; then see below
    const double left = share_left(level, std::max(factor, 1.));
    if (left <= 0) break;
    for (std::size_t slope = 0; slope < ImageStatistics::kSlopes; ++slope) {
      const double n = left * image.places[level][slope];
      seen += n * worths()[slope][i];
      places += n;
    }
  }
  if (factor < 1) {
    // nobody knows what hides in the light: as much as elsewhere, or something if there is no elsewhere
    const double appear = image.clipped_share * image.count * std::min(1., -log2_factor(i) / kLightTail);
    const double usual = places > 0.1 * image.count ? seen / places : 0.5;
    seen += appear * usual;
    places += appear;
  }
  return (seen - kClippedCost * (image.count - places)) / image.count;
}

// ---- the controller ----

constexpr int kImages = 3;  // whose mean is looked at: lamps make one image bright, the next one dark
constexpr double kStart = 0.20, kStop = 0.08;  // logarithms of factors: it moves beyond one, until within the other
constexpr double kDamping = 0.8;               // a sensor whose brightness grows faster than the light must not swing
constexpr double kFar = 0.9;                   // beyond, the image is of little use: then large steps
constexpr double kStepMost = 0.3;              // else steps below what health calls an exposure step
constexpr double kBandMargin = 1.3, kBandMost = 0.9;  // a band that grows when it was left in vain ...
constexpr double kBandDecay = 0.997;                  // ... and shrinks to the half in 700 images
constexpr double kReachMost = 2;                      // logarithm: more than is ever wanted
constexpr int kLongCalm = 10;                         // decisions: longer than a step of its own takes to show
constexpr double kCalm = 0.97;                        // decay of the recent rotation rate per image
constexpr double kWorthwhile = 1.5;                   // a longer exposure is taken up when it is longer by so much
constexpr double kSameTotal = 0.02;                   // relative

}  // namespace

double wanted_log_factor(const ImageStatistics& image, double brightness) noexcept {
  if (image.count == 0) return 0;
  std::array<double, kFactors> worth{};
  for (std::size_t i = 0; i < kFactors; ++i) {
    const double off = std::log(std::max(image.mean, 1.) / brightness) + log2_factor(i) * std::log(2.);
    worth[i] = information(image, i) - kMeanWeight * off * off;
  }
  const auto best = static_cast<std::size_t>(std::max_element(worth.begin(), worth.end()) - worth.begin());
  double between = 0;  // the top of the parabola through the best and its neighbours
  if (best > 0 && best + 1 < kFactors) {
    const double bend = worth[best - 1] - 2 * worth[best] + worth[best + 1];
    if (bend < 0) between = std::clamp(0.5 * (worth[best - 1] - worth[best + 1]) / bend, -0.5, 0.5);
  }
  return (log2_factor(best) + between / kPerOctave) * std::log(2.);
}

ExposureController::ExposureController(const ExposureLimits& limits) noexcept : limits_(limits) {
  worths();  // made now, not with the first image
}

Span ExposureController::longest() const noexcept {
  Span longest = limits_.longest;
  const double speed_px_s = limits_.focal_px * turn_rate_;
  if (limits_.blur_px > 0 && speed_px_s > 0)
    longest.ns = std::min(longest.ns, static_cast<std::int64_t>(limits_.blur_px / speed_px_s * 1e9));
  return std::max(longest, limits_.shortest);
}

ExposureState ExposureController::split(double total) const noexcept {
  const double shortest = limits_.shortest.seconds();
  double time = std::clamp(total / limits_.gain_least, shortest, longest().seconds());
  const double period = limits_.flicker_hz > 0 ? 1 / limits_.flicker_hz : 0;
  if (period > 0 && time >= period) time = std::floor(time / period * (1 + 1e-9)) * period;
  return {Span::from_seconds(time), std::clamp(total / time, limits_.gain_least, limits_.gain_most)};
}

/// The part of the wanted change that is made now; 0: none.
double ExposureController::step_of(double wanted) noexcept {
  band_ = std::max(kStart, kBandDecay * band_);
  // What it wants after a long calm is the light's doing, not an answer to its own last step.
  if (!is_moving_ && ++calm_ >= kLongCalm) last_step_ = 0;
  const bool is_back = last_step_ * wanted < 0;
  // Back where it came from, again: what the clipped part was thought to hide is not there. Better stay.
  if (is_back && is_moving_ && ++turns_ > 1)
    band_ = std::min(kBandMost, std::max(band_, kBandMargin * std::abs(wanted)));
  is_moving_ = std::abs(wanted) > (is_moving_ && !is_back ? kStop : band_);
  if (!is_moving_) {
    if (band_ <= kStart) turns_ = 0;
    return 0;
  }
  if (last_step_ == 0) reach_ = kReachMost;
  calm_ = 0;
  reach_ = is_back ? std::abs(last_step_) / 2 : std::min(2 * reach_, kReachMost);
  const double most = std::min(reach_, std::abs(wanted) > kFar ? kReachMost : kStepMost);
  last_step_ = std::clamp(kDamping * wanted, -most, most);
  return last_step_;
}

std::optional<ExposureState> ExposureController::step(const ImageStatistics& image,
                                                      const ExposureTimeline::OfImage& exposure,
                                                      double turn_rate_rad_s) noexcept {
  turn_rate_ = std::max(turn_rate_rad_s, kCalm * turn_rate_);
  if (!exposure.is_settled) {
    sum_ = 0;
    images_ = 0;
    return std::nullopt;
  }
  sum_ += wanted_log_factor(image, limits_.brightness);
  if (++images_ < kImages) return std::nullopt;
  const double change = step_of(sum_ / images_);
  sum_ = 0;
  images_ = 0;

  const double total = exposure.state.total();
  const ExposureState next = split(total * std::exp(change));
  const bool is_blurred = exposure.state.time.ns > longest().ns + longest().ns / 10;
  const bool could_be_longer =
      exposure.state.gain > limits_.gain_least &&
      static_cast<double>(next.time.ns) > kWorthwhile * static_cast<double>(exposure.state.time.ns);
  if (change == 0 && !is_blurred && !could_be_longer) return std::nullopt;
  if (next.time == exposure.state.time && std::abs(next.gain / exposure.state.gain - 1) < kSameTotal)
    return std::nullopt;  // at a limit
  return next;
}

}  // namespace epiline
