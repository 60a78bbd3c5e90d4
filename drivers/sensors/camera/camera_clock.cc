#include "drivers/sensors/camera/camera_clock.h"

#include <limits>

#include "drivers/sensors/trouble.h"

namespace epiline {

namespace {

constexpr std::uint32_t kLeastTicks_hz = 1'000;
constexpr int kAtOnce = 16;  // images whose metadata are read with one image; the node has fewer buffers

}  // namespace

DeviceTrouble CameraClock::open(const V4l2Device& camera) noexcept {
  if (!is_used()) return {};
  const std::uint32_t told = settings_.clock_hz > 0 ? settings_.clock_hz : clock_hz_of(system_, camera);
  if (told < kLeastTicks_hz)
    return unexpected("camera.clock_hz", "the ticks per second, or camera.clock = \"driver\"",
                      "the camera does not tell how fast its clock runs");
  clock_.emplace(told);
  newest_ = {std::numeric_limits<std::int64_t>::min()};
  return node_.open(camera);
}

bool CameraClock::stamp(std::uint32_t sequence, HostStamp& stamp) noexcept {
  if (!is_used() || !clock_) return true;
  std::uint32_t of = 0;
  std::span<const std::uint8_t> metadata;
  for (int i = 0; i < kAtOnce && node_.read(of, metadata); ++i)
    if (!clock_->add(of, metadata, {system_.now_ns()})) ++bad_metadata_;
  if (!clock_->stamp(sequence, stamp)) ++without_clock_;
  shown_.write(clock_->state());
  if (stamp <= newest_) return false;
  newest_ = stamp;
  return true;
}

}  // namespace epiline
