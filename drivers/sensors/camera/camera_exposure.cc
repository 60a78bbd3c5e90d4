#include "drivers/sensors/camera/camera_exposure.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {

constexpr int kChangesAtOnce = 8;  // told of by the device; the rest waits for the next image

}  // namespace

CameraExposure::CameraExposure(const V4l2Settings& settings)
    : settings_(settings),
      timeline_(settings.control_of_exposure.delay_images),
      automatic_(settings.control_of_exposure.automatic) {}

// ---- values of controls and what they mean ----

double CameraExposure::gain_of(std::int64_t value) const noexcept {
  if (gain_control_.id == 0) return 1;
  const double amount = static_cast<double>(value) * settings_.control_of_exposure.gain_unit;
  return settings_.control_of_exposure.gain_scale == 0 ? std::max(amount, 1e-3) : std::pow(10, amount / 20);
}

std::int64_t CameraExposure::value_of_gain(double gain) const noexcept {
  const double amount = settings_.control_of_exposure.gain_scale == 0 ? gain : 20 * std::log10(gain);
  return std::clamp<std::int64_t>(std::llround(amount / settings_.control_of_exposure.gain_unit), gain_control_.least,
                                  gain_control_.most);
}

std::int64_t CameraExposure::value_of_time(Span time) const noexcept {
  const std::int64_t unit = std::max<std::int64_t>(settings_.exposure.ns, 1);
  return std::clamp((time.ns + unit / 2) / unit, time_control_.least, time_control_.most);
}

ExposureState CameraExposure::setting() const noexcept {
  return {Span{time_control_.id == 0 ? settings_.exposure.ns : time_value_ * settings_.exposure.ns},
          gain_of(gain_value_)};
}

// ---- setting up ----

DeviceTrouble CameraExposure::set_up(V4l2Device& device) noexcept {
  const ExposureConfig& config = settings_.control_of_exposure;
  const auto find = [&device](const std::string& name, ControlFacts& facts, std::int64_t& value) {
    facts = {};
    if (name.empty()) return DeviceTrouble{};
    if (const DeviceTrouble trouble = device.controls().find(name.c_str(), facts)) return trouble;
    device.watch_control(facts);
    return device.controls().read(name.c_str(), facts, value);
  };
  if (const DeviceTrouble trouble = find(settings_.exposure_control, time_control_, time_value_)) return trouble;
  if (const DeviceTrouble trouble = find(config.gain_control, gain_control_, gain_value_)) return trouble;
  timeline_.begin(setting());
  of_image_.state = setting();
  report_.time = of_image_.state.time;
  shown_report_.write(report_);
  wanted_.reset();
  asked_for_ = {};
  is_changing_ = false;
  if (time_control_.id == 0) return {};
  ExposureLimits limits;
  limits.shortest = Span{value_of_time(Span::from_seconds(1e-3 * config.shortest_ms)) * settings_.exposure.ns};
  limits.longest = Span{value_of_time(Span::from_seconds(1e-3 * config.longest_ms)) * settings_.exposure.ns};
  if (gain_control_.id != 0) {
    // amplification below 1 is none; who measures gain in other units has their least value as 1
    limits.gain_least = gain_of(value_of_gain(1));
    limits.gain_most = std::max(limits.gain_least, gain_of(value_of_gain(config.gain_most)));
  }
  limits.blur_px = config.blur_px;
  limits.focal_px = settings_.focal_px;
  limits.brightness = config.brightness;
  limits.flicker_hz = config.flicker_hz;
  controller_.emplace(limits);
  return {};
}

// ---- changes ----

bool CameraExposure::next_change(ControlJob& job) noexcept {
  if (!wanted_) return false;
  const ExposureState wanted = *wanted_;
  wanted_.reset();
  job = {};
  const auto set = [&job](const ControlFacts& facts, std::int64_t value) {
    ControlJob::Entry& entry = job.entries[job.count++];
    entry.facts = facts;
    entry.wanted = value;
  };
  const std::int64_t time = value_of_time(wanted.time);
  if (time != time_value_) set(time_control_, time);
  const std::int64_t gain = gain_control_.id != 0 ? value_of_gain(wanted.gain) : gain_value_;
  if (gain != gain_value_) set(gain_control_, gain);
  is_changing_ = job.count > 0;
  return is_changing_;
}

void CameraExposure::ended(const ControlJob& job) noexcept {
  is_changing_ = false;
  ++(job.is_set ? report_.changes : report_.refused);
  shown_report_.write(report_);
  if (!job.is_set) return;  // a device that is lost shows it with the next image
  for (std::size_t i = 0; i < job.count; ++i)
    (job.entries[i].facts.id == time_control_.id ? time_value_ : gain_value_) = job.entries[i].value;
  timeline_.change(job.at, setting());
}

void CameraExposure::note_changes(V4l2Device& device) noexcept {
  std::uint32_t id = 0;
  std::int64_t value = 0;
  HostStamp at;
  for (int i = 0; i < kChangesAtOnce && device.next_change(id, value, at); ++i) changed(id, value, at);
}

void CameraExposure::changed(std::uint32_t id, std::int64_t value, HostStamp at) noexcept {
  if (id == 0 || (id != time_control_.id && id != gain_control_.id)) return;
  std::int64_t& ours = id == time_control_.id ? time_value_ : gain_value_;
  if (ours == value) return;
  ours = value;
  timeline_.change(at, setting());
}

// ---- images ----

Span CameraExposure::time_of(HostStamp given, std::uint64_t sequence) noexcept {
  of_image_ = timeline_.image(given, sequence);
  if (is_changing_) of_image_.is_settled = false;
  report_.time = of_image_.state.time;
  report_.gain = of_image_.state.gain;
  shown_report_.write(report_);
  return of_image_.state.time;
}

void CameraExposure::look(const Frame& frame) noexcept {
  if (followed_time_ns_.load(std::memory_order_relaxed) > 0) return look_at_other();
  if (!controller_ || !automatic_.load(std::memory_order_relaxed)) return;
  const ImageStatistics image = statistics_of(frame.data, frame.width, frame.height, frame.stride);
  timeline_.brightness(image.mean);
  wanted_ = controller_->step(image, of_image_, turn_rate_.load(std::memory_order_relaxed));
  report_.brightness = image.mean;
  report_.dark_share = image.dark_share;
  report_.clipped_share = image.clipped_share;
  report_.delay_images = timeline_.delay();
  report_.is_delay_known = timeline_.is_delay_known();
  shown_report_.write(report_);
}

/// Asks for each of the other camera's settings once: this one may round it.
void CameraExposure::look_at_other() noexcept {
  const ExposureState other{Span{followed_time_ns_.load(std::memory_order_relaxed)},
                            followed_gain_.load(std::memory_order_relaxed)};
  if (time_control_.id == 0 || is_changing_ || (other.time == asked_for_.time && other.gain == asked_for_.gain)) return;
  wanted_ = asked_for_ = other;
}

ExposureReport CameraExposure::report() const noexcept {
  ExposureReport report = shown_report_.read();
  report.is_automatic = automatic_.load(std::memory_order_relaxed);
  return report;
}

}  // namespace epiline
