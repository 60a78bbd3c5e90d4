#include "pipeline/library/odometer.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>

#include "pipeline/config/vehicle.h"
#include "platform/linux/realtime.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

Error refusal(std::string found, std::string expected) {
  return {ErrorKind::kUsage, "", 0, std::move(found), std::move(expected)};
}

Error too_many(const char* what) {
  return refusal(std::string("too many ") + what + " wait", "a step after each push");
}

Result<OfflineSettings> offline_settings(const ConfigFile& file, bool images) {
  Config config;
  OfflineSettings settings;
  file.apply(config);  // for the names of calibration files
  if (config.camera_calibration.empty())
    return refusal("camera.calibration is not set", "the name of the camera's calibration file");
  if (!config.masks[0].empty()) return refusal("camera.mask is set", "none: the library reads no image files");
  auto camera = read_camera_calibration(config.camera_calibration, "cam0");
  if (!camera) return camera.error();
  set_shutter(config.devices.camera, camera->parameters);
  set_calibration(*camera, config.estimator);
  if (!config.imu_calibration.empty()) {
    const auto imu = read_imu_calibration(config.imu_calibration);
    if (!imu) return imu.error();
    set_calibration(*imu, config.estimator);
    settings.imu_correction = imu->correction;
  }
  file.apply(config);  // the settings win
  set_vehicle(config);
  settings.camera = camera->parameters;
  settings.tracker = config.tracker;
  settings.estimator = config.estimator;
  settings.deadline_ms = config.deadline_ms;
  settings.images = images;
  return settings;
}

OfflineSettings completed(OfflineSettings settings) {
  settings.clocks = {monotonic_ns, thread_cpu_ns};
  settings.recorded.assign(settings.images ? 0 : 1, {});  // points of the image that is stepped
  settings.log.reset();
  return settings;
}

}  // namespace

Result<std::unique_ptr<Odometer>> Odometer::create(const ConfigFile& settings, bool images) {
  const auto offline = offline_settings(settings, images);
  if (!offline) return offline.error();
  try {
    return std::make_unique<Odometer>(*offline);
  } catch (const std::invalid_argument& e) {
    return refusal(e.what(), "settings that are consistent with each other");
  }
}

Odometer::Odometer(const OfflineSettings& settings)
    : images_(settings.images), camera_(settings.camera), pipeline_(completed(settings)) {
  for (Buffer& buffer : buffers_) {
    if (images_)
      buffer.pixels.resize(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height));
    else
      buffer.points.reserve(kMaxFeatures);
  }
}

Odometer::Waiting* Odometer::claim(HostStamp stamp) noexcept {
  if (waiting_count_ == kMostImages) return nullptr;
  const auto free = std::find_if(buffers_.begin(), buffers_.end(), [](const Buffer& b) { return !b.in_use; });
  free->in_use = true;
  Waiting& image = waiting_[waiting_count_++];
  image = {{}, static_cast<std::size_t>(free - buffers_.begin())};
  image.frame.stamp = image.frame.arrival = stamp;
  return &image;
}

Status Odometer::push_image(const Frame& image) {
  if (!images_) return refusal("an image", "tracks, as the odometer was created for them");
  if (image.width != camera_.width || image.height != camera_.height)
    return refusal(std::to_string(image.width) + "x" + std::to_string(image.height) + " pixels",
                   std::to_string(camera_.width) + "x" + std::to_string(camera_.height) + " as in the calibration");
  Waiting* const to = claim(image.stamp);
  if (to == nullptr) return too_many("images");
  std::uint8_t* const pixels = buffers_[to->buffer].pixels.data();
  for (int y = 0; y < image.height; ++y)
    std::memcpy(pixels + std::ptrdiff_t{y} * image.width, image.data + std::ptrdiff_t{y} * image.stride,
                static_cast<std::size_t>(image.width));
  to->frame.sequence = sequence_++;
  to->frame.data = pixels;
  to->frame.width = to->frame.stride = image.width;
  to->frame.height = image.height;
  return Done{};
}

Status Odometer::push_tracks(HostStamp stamp, std::span<const TrackPoint> points) {
  if (images_) return refusal("tracks", "images, as the odometer was created for them");
  if (points.size() > kMaxFeatures)
    return refusal(std::to_string(points.size()) + " points", "at most " + std::to_string(kMaxFeatures));
  Waiting* const to = claim(stamp);
  if (to == nullptr) return too_many("images");
  buffers_[to->buffer].points.assign(points.begin(), points.end());
  return Done{};
}

Status Odometer::push_imu(const ImuSample& sample) {
  if (imu_.published() - imu_.popped() == kImuRing) {
    if (waiting_count_ > 0) return too_many("IMU samples");
    give_oldest_imu();  // between images that are far apart
  }
  ImuSample arrived = sample;
  arrived.arrival = sample.stamp;
  imu_.push(arrived);
  return Done{};
}

Status Odometer::push_wheel(const WheelSample& sample) {
  return wheel_.ring.push(sample) ? Status(Done{}) : too_many("wheel speeds");
}
Status Odometer::push_height(const HeightSample& sample) {
  return height_.ring.push(sample) ? Status(Done{}) : too_many("heights");
}

void Odometer::give_oldest_imu() noexcept {
  ImuSample sample = *imu_.front();
  imu_.pop();
  if (pipeline_.add_imu(sample)) feed_.took(sample);
}

/// True: the image has all that it needs.
bool Odometer::feed_imu(HostStamp image) noexcept {
  const HostStamp needed = pipeline_.imu_needed_until(image);
  while (feed_.wants_more(needed)) {
    if (imu_.front() == nullptr) return ended_;
    give_oldest_imu();
  }
  return true;
}

/// Those that have come up to the image, and one more.
void Odometer::feed_sides(HostStamp image) noexcept {
  const HostStamp needed = pipeline_.imu_needed_until(image);
  const auto feed = [&](auto& side, auto&& add) {
    for (; side.ring.front() != nullptr && (!side.last || *side.last < needed); side.ring.pop()) {
      side.last = side.ring.front()->stamp;
      add(*side.ring.front());
    }
  };
  feed(wheel_, [&](const WheelSample& s) { pipeline_.add_wheel(s); });
  feed(height_, [&](const HeightSample& s) { pipeline_.add_height(s); });
}

bool Odometer::step() noexcept {
  while (waiting_count_ > 0) {
    Waiting& oldest = waiting_[0];
    if (!admitted_) {
      if (!pipeline_.admit(oldest.frame)) {
        done_with(oldest);
        continue;
      }
      admitted_ = oldest.frame;
    }
    if (!feed_imu(admitted_->stamp)) return false;
    feed_sides(admitted_->stamp);
    if (!images_) pipeline_.set_recorded(0, buffers_[oldest.buffer].points);
    pipeline_.step(*admitted_, outcome_);
    for (Event event; pipeline_.events().pop(event);) {
    }
    done_with(oldest);
    return true;
  }
  return false;
}

/// The tracker keeps the image that it has seen in place of the one before.
void Odometer::done_with(const Waiting& image) noexcept {
  const std::size_t buffer = image.buffer;
  const bool is_seen = admitted_ && !is_blind(admitted_->reasons);
  if (is_seen && kept_) buffers_[*kept_].in_use = false;
  if (is_seen)
    kept_ = buffer;
  else
    buffers_[buffer].in_use = false;
  admitted_.reset();
  std::move(waiting_.begin() + 1, waiting_.begin() + static_cast<std::ptrdiff_t>(waiting_count_), waiting_.begin());
  --waiting_count_;
}

}  // namespace epiline
