#include "drivers/flights/recordings/fault_injection.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr double kToTheEnd = 1e6;
constexpr FaultInfo kFaults[] = {
    {FaultKind::kCameraSilent, "camera-silent", 1, "no images arrive"},
    {FaultKind::kCameraAhead, "camera-ahead", 2, "image timestamps jump 0.5 s ahead, and back afterwards"},
    {FaultKind::kCameraBehind, "camera-behind", 2, "image timestamps jump 0.5 s back, and ahead afterwards"},
    {FaultKind::kCameraFrozen, "camera-frozen", 1, "the same image again and again"},
    {FaultKind::kCameraBlack, "camera-black", 1, "black images with a little noise, as with a covered lens"},
    {FaultKind::kCameraWhite, "camera-white", 1, "white images"},
    {FaultKind::kCameraHalf, "camera-half", 5, "the left half of the image is covered"},
    {FaultKind::kCameraExposure, "camera-exposure", 2, "images suddenly half as bright"},
    {FaultKind::kImuSilent, "imu-silent", 0.1, "IMU samples are lost"},
    {FaultKind::kImuDuplicates, "imu-duplicates", 1, "each IMU sample arrives twice"},
    {FaultKind::kImuDisorder, "imu-disorder", 1, "every fifth IMU sample arrives after its successor"},
    {FaultKind::kImuNan, "imu-nan", 0.1, "IMU samples are not-a-number"},
    {FaultKind::kImuSaturated, "imu-saturated", 1, "rates are limited to 0.3 rad/s, specific forces to 10 m/s^2"},
    {FaultKind::kImuStuck, "imu-stuck", 1, "the same IMU sample with new timestamps"},
    {FaultKind::kImuOutlier, "imu-outlier", 0, "one IMU sample with a timestamp 10 s in the future"},
    {FaultKind::kImuAhead, "imu-ahead", 2, "IMU timestamps jump 0.5 s ahead, and back afterwards"},
    {FaultKind::kImuBehind, "imu-behind", 2, "IMU timestamps jump 0.5 s back, and ahead afterwards"},
    {FaultKind::kImuDrift, "imu-drift", kToTheEnd, "the IMU's clock runs fast by 200 ppm"},
};
constexpr Span kJump = Span::from_milliseconds(500);
constexpr Span kFarFuture = Span::from_milliseconds(10'000);
constexpr double kDrift = 200e-6;
constexpr double kRateLimit = 0.3, kForceLimit = 10;  // rad/s, m/s^2

bool number(std::string_view text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() && std::isfinite(value) && value >= 0;
}

}  // namespace

std::span<const FaultInfo> all_faults() noexcept { return kFaults; }
const char* to_string(FaultKind kind) noexcept { return kFaults[static_cast<std::size_t>(kind)].name; }
bool is_of_imu(FaultKind kind) noexcept { return kind >= FaultKind::kImuSilent; }

Result<Fault> fault_from(const std::string& text) {
  const Error error{ErrorKind::kUsage, "--fault", 0, "\"" + text + "\"",
                    "NAME@SECONDS[:DURATION] with a name that `epiline replay --help` lists"};
  const std::size_t at = text.find('@');
  if (at == std::string::npos) return error;
  const auto info = std::find_if(std::begin(kFaults), std::end(kFaults),
                                 [&](const FaultInfo& f) { return text.substr(0, at) == f.name; });
  if (info == std::end(kFaults)) return error;
  Fault fault{info->kind, 0, info->usual_duration_s};
  const std::string_view times = std::string_view(text).substr(at + 1);
  const std::size_t colon = times.find(':');
  if (!number(times.substr(0, colon), fault.from_s)) return error;
  if (colon != std::string_view::npos && !number(times.substr(colon + 1), fault.duration_s)) return error;
  return fault;
}

FaultTimes::FaultTimes(std::span<const Fault> faults, HostStamp zero)
    : faults_(faults.begin(), faults.end()), zero_(zero) {}

const Fault* FaultTimes::active(FaultKind kind, HostStamp arrival) const noexcept {
  const double t_s = (arrival - zero_).seconds();
  const auto found = std::find_if(faults_.begin(), faults_.end(), [&](const Fault& f) {
    return f.kind == kind && t_s >= f.from_s && t_s < f.from_s + f.duration_s;
  });
  return found == faults_.end() ? nullptr : &*found;
}

/// Faults that change a reading and neither add nor take one.
void ImuFaults::change(ImuSample& r) noexcept {
  const HostStamp arrival = r.arrival;
  if (active(FaultKind::kImuNan, arrival)) r.angular_velocity_rad_s[1] = std::numeric_limits<double>::quiet_NaN();
  if (active(FaultKind::kImuSaturated, arrival)) {
    for (double& w : r.angular_velocity_rad_s) w = std::clamp(w, -kRateLimit, kRateLimit);
    for (double& a : r.specific_force_m_s2) a = std::clamp(a, -kForceLimit, kForceLimit);
  }
  if (!active(FaultKind::kImuStuck, arrival)) {
    stuck_.reset();
  } else {
    if (!stuck_) stuck_ = r;
    r.angular_velocity_rad_s = stuck_->angular_velocity_rad_s;
    r.specific_force_m_s2 = stuck_->specific_force_m_s2;
  }
  if (active(FaultKind::kImuAhead, arrival)) r.stamp = r.stamp + kJump;
  if (active(FaultKind::kImuBehind, arrival)) r.stamp = r.stamp - kJump;
  if (const Fault* drift = active(FaultKind::kImuDrift, arrival))
    r.stamp = r.stamp + Span::from_seconds(kDrift * ((arrival - zero_).seconds() - drift->from_s));
}

std::size_t ImuFaults::apply(const ImuSample& reading, std::array<ImuSample, kMost>& out) noexcept {
  const HostStamp arrival = reading.arrival;
  std::size_t n = 0;
  if (active(FaultKind::kImuSilent, arrival)) return n;
  ImuSample r = reading;
  change(r);
  if (!held_ && count_++ % 5 == 0 && active(FaultKind::kImuDisorder, arrival)) {
    held_ = r;
    return n;
  }
  // an outlier has no length: it is the first reading at its time
  const auto outlier = std::find_if(faults_.begin(), faults_.end(), [&](const Fault& f) {
    return f.kind == FaultKind::kImuOutlier && (arrival - zero_).seconds() >= f.from_s;
  });
  if (outlier != faults_.end()) {
    r.stamp = r.stamp + kFarFuture;
    faults_.erase(outlier);
  }
  out[n++] = r;
  if (active(FaultKind::kImuDuplicates, arrival)) out[n++] = r;
  if (held_) {
    out[n] = *held_;
    out[n++].arrival = arrival;
    held_.reset();
  }
  return n;
}

CameraFaults::CameraFaults(std::span<const Fault> faults, HostStamp first_image, int width, int height,
                           std::size_t buffers)
    : FaultTimes(faults, first_image), pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
  if (faults_.empty()) return;
  copies_.assign(buffers, std::vector<std::uint8_t>(pixels_));
  frozen_.resize(pixels_);
}

std::uint8_t* CameraFaults::own(Frame& image) noexcept {
  std::vector<std::uint8_t>& copy =
      copies_[image.slot >= 0 ? static_cast<std::size_t>(image.slot) : next_copy_++ % copies_.size()];
  const auto width = static_cast<std::size_t>(image.width);
  for (int y = 0; y < image.height; ++y)
    std::memcpy(copy.data() + static_cast<std::size_t>(y) * width, image.data + std::ptrdiff_t{y} * image.stride,
                width);
  image.data = copy.data();
  image.stride = image.width;
  return copy.data();
}

bool CameraFaults::apply(Frame& image) noexcept {
  const HostStamp arrival = image.arrival;
  if (active(FaultKind::kCameraSilent, arrival)) return false;
  if (active(FaultKind::kCameraAhead, arrival)) image.stamp = image.stamp + kJump;
  if (active(FaultKind::kCameraBehind, arrival)) image.stamp = image.stamp - kJump;
  if (image.data == nullptr || faults_.empty()) return true;

  const bool frozen = active(FaultKind::kCameraFrozen, arrival) != nullptr;
  if (frozen) {
    std::uint8_t* const pixels = own(image);
    if (has_frozen_)
      std::copy(frozen_.begin(), frozen_.end(), pixels);
    else
      std::copy(pixels, pixels + pixels_, frozen_.begin());
  }
  has_frozen_ = frozen;
  if (active(FaultKind::kCameraBlack, arrival)) {
    std::uint8_t* const pixels = own(image);
    for (std::size_t i = 0; i < pixels_; ++i) {
      noise_ = noise_ * 1664525U + 1013904223U;
      pixels[i] = static_cast<std::uint8_t>((noise_ >> 24) % 3);
    }
  }
  if (active(FaultKind::kCameraWhite, arrival)) std::fill_n(own(image), pixels_, std::uint8_t{255});
  if (active(FaultKind::kCameraHalf, arrival)) {
    std::uint8_t* const pixels = own(image);
    for (int y = 0; y < image.height; ++y)
      std::fill_n(pixels + static_cast<std::ptrdiff_t>(y) * image.width, image.width / 2, std::uint8_t{10});
  }
  if (active(FaultKind::kCameraExposure, arrival)) {
    std::uint8_t* const pixels = own(image);
    for (std::size_t i = 0; i < pixels_; ++i) pixels[i] = static_cast<std::uint8_t>(pixels[i] / 2);
  }
  return true;
}

ReadOutcome FaultyImu::read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept {
  const std::int64_t deadline_ns = monotonic_ns() + timeout.ns;
  count = 0;
  do {
    std::array<ImuSample, kChunk> chunk;
    const std::size_t room = std::min(kChunk, samples.size() / ImuFaults::kMost);
    std::size_t read = 0;
    const Span left{std::max<std::int64_t>(0, deadline_ns - monotonic_ns())};
    const ReadOutcome outcome = imu_.read(std::span(chunk).first(room), read, left);
    if (outcome != ReadOutcome::kSample) return outcome;
    for (std::size_t i = 0; i < read; ++i) {
      std::array<ImuSample, ImuFaults::kMost> out;
      const std::size_t n = faults_.apply(chunk[i], out);
      for (std::size_t k = 0; k < n; ++k) samples[count++] = out[k];
    }
  } while (count == 0 && monotonic_ns() < deadline_ns);
  return count > 0 ? ReadOutcome::kSample : ReadOutcome::kTimeout;
}

ReadOutcome FaultyCamera::read(Frame& frame, Span timeout) noexcept {
  const std::int64_t deadline_ns = monotonic_ns() + timeout.ns;
  do {
    const Span left{std::max<std::int64_t>(0, deadline_ns - monotonic_ns())};
    const ReadOutcome outcome = camera_.read(frame, left);
    if (outcome != ReadOutcome::kSample || faults_.apply(frame)) return outcome;
    camera_.give_back(frame);
  } while (monotonic_ns() < deadline_ns);
  return ReadOutcome::kTimeout;
}

}  // namespace epiline
