#include "drivers/program/check/imu_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "drivers/program/check/spectrum.h"

namespace epiline {

namespace {

constexpr double kStillGyroscope = 0.03, kStillAccelerometer = 0.3;  // rad/s, m/s^2: deviation in a window at rest
constexpr double kStillRate = 0.35;                                  // rad/s: more is a turn, not a bias
constexpr double kNoiseShort = 0.5;                                  // s: averages up to here show white noise
constexpr std::uint64_t kFewDifferences = 20, kFewAtTheEnd = 9;
constexpr double kInstabilityNeeds = 60;  // s at rest
constexpr double kGravity = 9.81;

double most_of(const std::array<double, 3>& values) { return *std::max_element(values.begin(), values.end()); }

}  // namespace

// ---- AllanDeviation ----

void AllanDeviation::step(double value) noexcept {
  for (Octave& o : octaves_) {
    // `value` is an average over as many samples as this octave is long
    if (o.has_last) {
      o.squares += (value - o.last) * (value - o.last);
      ++o.count;
    }
    o.last = value;
    o.has_last = true;
    o.sum += value;
    if (++o.filled < 2) return;
    value = o.sum / 2;
    o.sum = 0;
    o.filled = 0;
  }
}

void AllanDeviation::interrupt() noexcept {
  for (Octave& o : octaves_) {
    o.has_last = false;
    o.sum = 0;
    o.filled = 0;
  }
}

double AllanDeviation::at(std::size_t octave) const noexcept {
  const Octave& o = octaves_[octave];
  return o.count > 0 ? std::sqrt(o.squares / (2 * static_cast<double>(o.count))) : 0;
}

// ---- ImuCheck ----

void ImuCheck::step(const ImuSample& reading) {
  pacing_.step(reading.stamp, reading.arrival);
  const auto axes = axes_of(reading);
  if (!is_finite(axes)) {
    ++not_finite_;
    return;
  }
  for (std::size_t i = 0; i < 6; ++i) {
    least_[i] = finite_ == 0 ? axes[i] : std::min(least_[i], axes[i]);
    most_[i] = finite_ == 0 ? axes[i] : std::max(most_[i], axes[i]);
  }
  ++finite_;
  if (!window_.empty() && reading.stamp - window_.front().stamp >= kWindow) end_window();
  window_.push_back(reading);
}

/// Was it still all the time? Then it is measured by.
void ImuCheck::end_window() {
  ImuAxes mean{}, deviation{};
  const auto n = static_cast<double>(window_.size());
  for (const ImuSample& r : window_)
    for (std::size_t i = 0; i < 6; ++i) mean[i] += axes_of(r)[i] / n;
  for (const ImuSample& r : window_)
    for (std::size_t i = 0; i < 6; ++i) deviation[i] += (axes_of(r)[i] - mean[i]) * (axes_of(r)[i] - mean[i]) / n;
  bool is_still = std::hypot(mean[0], mean[1], mean[2]) < kStillRate && window_.size() > 3;
  for (std::size_t i = 0; i < 6; ++i)
    is_still = is_still && std::sqrt(deviation[i]) < (i < 3 ? kStillGyroscope : kStillAccelerometer);
  if (is_still) {
    rest_s_ += (window_.back().stamp - window_.front().stamp).seconds();
    for (const ImuSample& r : window_)
      for (std::size_t i = 0; i < 6; ++i) {
        allan_[i].step(axes_of(r)[i]);
        rest_sum_[i] += axes_of(r)[i];
      }
    rest_samples_ += window_.size();
  } else {
    for (AllanDeviation& a : allan_) a.interrupt();
  }
  window_.clear();
}

ImuResult ImuCheck::result(HostStamp now) const {
  ImuResult r;
  r.pacing = pacing_.result(now);
  r.rest_s = rest_s_;
  r.not_finite = not_finite_;
  for (std::size_t i = 0; i < 6; ++i) r.dead_axes += finite_ > 10 && least_[i] == most_[i] ? 1 : 0;
  if (rest_samples_ == 0) return r;
  for (std::size_t i = 0; i < 6; ++i) {
    auto& mean = i < 3 ? r.gyroscope_rest_rad_s : r.accelerometer_rest_m_s2;
    auto& density = i < 3 ? r.gyroscope_density : r.accelerometer_density;
    auto& instability = i < 3 ? r.gyroscope_instability : r.accelerometer_instability;
    mean[i % 3] = rest_sum_[i] / static_cast<double>(rest_samples_);
    for (std::size_t k = 0; k < AllanDeviation::kOctaves; ++k) {
      const double tau = r.pacing.period_s * std::exp2(static_cast<double>(k));
      const double deviation = allan_[i].at(k);
      // the longest of the short times: filters and hum are averaged out, the bias does not walk yet
      if (tau <= kNoiseShort && allan_[i].differences(k) >= kFewDifferences)
        density[i % 3] = deviation * std::sqrt(tau);
      if (rest_s_ >= kInstabilityNeeds && allan_[i].differences(k) >= kFewAtTheEnd)
        instability[i % 3] = instability[i % 3] > 0 ? std::min(instability[i % 3], deviation) : deviation;
    }
  }
  const auto& a = r.accelerometer_rest_m_s2;
  r.gravity_m_s2 = std::hypot(a[0], a[1], a[2]);
  return r;
}

// ---- in words ----

namespace {

void say_pace(const ImuResult& r, const ImuExpectation& expected, const DeviceFindings& say) {
  const PacingResult& p = r.pacing;
  say.judge(fmt::format("{:.1f} samples per second, jitter {:.2f} ms, longest gap {:.1f} ms", p.rate_hz(),
                        1e3 * p.jitter_s, 1e3 * p.longest_s),
            {{p.rate_hz() < 50, Grade::kError,
              "it needs 100 to 1000 Hz: raise imu.rate_hz, or the stream rate of the flight controller"},
             {expected.rate_hz > 0 && std::abs(p.rate_hz() / expected.rate_hz - 1) > 0.05, Grade::kWarning,
              fmt::format("{:.0f} are configured (imu.rate_hz)", expected.rate_hz)},
             {p.jitter_s > 0.25 * p.period_s, Grade::kWarning,
              "timestamps are irregular; use the data-ready line or the chip's own clock"}});
  const std::uint64_t bad = p.missing + p.backwards + r.not_finite;
  if (bad == 0) return;
  say.judge(fmt::format("{} samples missing in {} gaps, {} with a timestamp not later than the previous one, {} "
                        "not finite",
                        p.missing, p.gaps, p.backwards, r.not_finite),
            {{true, bad > p.samples / 100 ? Grade::kError : Grade::kWarning,
              "check the bus speed, the cable, and other load on the computer"}});
}

void say_noise(const ImuResult& r, const ImuExpectation& expected, const DeviceFindings& say) {
  const auto judge = [&](const char* name, const std::array<double, 3>& density, double configured, const char* unit,
                         const char* key) {
    if (most_of(density) <= 0) return;
    const bool is_noisy = configured > 0 && most_of(density) > 3 * configured;
    const std::string better = fmt::format("{:.1e}", 1.5 * most_of(density));
    say.judge(
        fmt::format("{} noise {:.2e} {:.2e} {:.2e} {} at rest, configured {:.2e}", name, density[0], density[1],
                    density[2], unit, configured),
        {{is_noisy,
          Grade::kWarning,
          fmt::format("switch motors and fans off and repeat; else dampen the mount, or set imu.{} to {}", key, better),
          {"imu", key, std::stod(better)}}});
  };
  judge("gyroscope", r.gyroscope_density, expected.gyroscope_density, "rad/s/sqrt(Hz)", "gyroscope_noise_density");
  judge("accelerometer", r.accelerometer_density, expected.accelerometer_density, "m/s^2/sqrt(Hz)",
        "accelerometer_noise_density");
  if (most_of(r.gyroscope_instability) > 0)
    say.ok(
        fmt::format("minimum of the Allan deviation in {:.0f} s at rest: gyroscope {:.2g} rad/s, "
                    "accelerometer {:.2g} m/s^2",
                    r.rest_s, most_of(r.gyroscope_instability), most_of(r.accelerometer_instability)));
}

void say_gravity(const ImuResult& r, const DeviceFindings& say) {
  const double g = r.gravity_m_s2;
  const auto& a = r.accelerometer_rest_m_s2;
  if (std::abs(g - kGravity) > 0.3)
    say.judge(
        fmt::format("the accelerometer measures {:.3f} m/s^2 at rest", g),
        {{std::abs(g - 1) < 0.1, Grade::kError, "samples are in g, 9.81 times too small; correct the device's scale"},
         {std::abs(g - kGravity) > 1, Grade::kError,
          "gravity is 9.81 m/s^2: wrong scale or measuring range, or a broken axis"},
         {true, Grade::kWarning, "gravity is 9.81 m/s^2: calibrate the accelerometer (offset, scale)"}});
  else
    say.ok(fmt::format("gravity {:.3f} m/s^2, up is ({:+.2f}, {:+.2f}, {:+.2f}) in its axes", g, a[0] / g, a[1] / g,
                       a[2] / g));
  const auto& w = r.gyroscope_rest_rad_s;
  const double bias = std::hypot(w[0], w[1], w[2]);
  say.judge(fmt::format("the gyroscope measures {:.4f} rad/s at rest", bias),
            {{bias > 0.1, Grade::kWarning, "large for a bias: keep it at rest, let it warm up, or calibrate it"}});
}

}  // namespace

Findings findings_of(const ImuResult& r, const ImuExpectation& expected) {
  Findings out;
  const DeviceFindings say("imu", out);
  if (r.pacing.samples < 10) {
    say.error(fmt::format("{} samples", r.pacing.samples),
              "it opened but delivers none: check its data-ready line, trigger and supply");
    return out;
  }
  say_pace(r, expected, say);
  say_silence(r.pacing, say);
  if (r.dead_axes > 0)
    say.error(fmt::format("{} of 6 axes never change", r.dead_axes), "enable all axes; else the sensor is broken");
  if (r.rest_s < 1) {
    say.warn(fmt::format("at rest for {:.1f} s only: noise and gravity not checked", r.rest_s),
             "keep it at rest for some seconds during the check");
    return out;
  }
  say_noise(r, expected, say);
  say_gravity(r, say);
  return out;
}

}  // namespace epiline
