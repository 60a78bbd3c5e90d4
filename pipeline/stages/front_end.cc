#include "pipeline/stages/front_end.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>

namespace epiline {

namespace {
/// The second camera S of a rig whose first one is C.
SecondRig rig_of(const CameraMount& C, const OtherLens& S) {
  const Mat3 R_SB = S.mount.R_BC.transpose();
  return {S.camera, R_SB * C.R_BC, R_SB * (C.p_BC - S.mount.p_BC)};
}

Span half_readout_of(const CameraParameters& camera) { return Span::from_seconds(0.5 * std::abs(camera.readout_s)); }
}  // namespace

OtherLenses lenses_of(const std::array<std::optional<CameraParameters>, kMostOthers>& cameras,
                      const EstimatorConfig& estimator) {
  OtherLenses lenses;
  for (std::size_t i = 0; i < kMostOthers; ++i)
    if (cameras[i]) lenses[i] = {*cameras[i], {estimator.others[i].R_BC, estimator.others[i].p_BC}};
  return lenses;
}

OtherSpans apart_of(const EstimatorConfig& estimator) {
  constexpr double kRounding_s = 1e-6;
  OtherSpans apart{};
  for (std::size_t i = 0; i < kMostOthers; ++i)
    if (const double apart_s = estimator.others[i].apart_s; apart_s > 0)
      apart[i] = Span::from_seconds(apart_s + kRounding_s);
  return apart;
}

FrontEnd::FrontEnd(const Camera& camera, const TrackerConfig& config, const CameraMount& mount,
                   const OtherLenses& others)
    : tracker_(camera, config), first_{mount, half_readout_of(camera.parameters()), {}, {}} {
  for (std::size_t number = 1; number <= kMostOthers; ++number)
    if (others[number - 1]) add_other(number, camera, config, others);
}

void FrontEnd::add_other(std::size_t number, const Camera& first, const TrackerConfig& config,
                         const OtherLenses& others) {
  const OtherLens& lens = *others[number - 1];
  const auto camera_of = [&](std::size_t c) { return c == 0 ? first : Camera(others[c - 1]->camera); };
  std::size_t beside = 0;
  for (std::size_t c = 0; c < number; ++c) {
    if (c > 0 && !others_[c - 1]) continue;
    if (SecondTracker::why_apart(camera_of(c), rig_of(camera(c).mount, lens)) != nullptr) continue;
    beside = c;
    break;
  }
  others_[number - 1].emplace(Mounted{lens.mount, half_readout_of(lens.camera), {}, {}}, beside, camera_of(beside),
                              rig_of(camera(beside).mount, lens), config, number);
}

void FrontEnd::set_knowledge(const Knowledge& known) noexcept {
  known_ = known;
  gyroscope_bias_rad_s_ = vec3(known.gyroscope_bias_rad_s);
  time_offset_ = Span::from_seconds(known.time_offset_s);
}

const SecondStats* FrontEnd::other_stats(std::size_t number) const noexcept {
  return others_[number - 1] ? &others_[number - 1]->tracker.stats() : nullptr;
}

// From so long before an image's stamp to so long after it; X is a camera.
RowTurn FrontEnd::turn_within(const Mat3& R_BX, HostStamp image, Span within) const {
  if (within == Span{}) return {};
  const HostStamp t = image + time_offset_;
  return row_turn(gyro_.between(t - within, t, gyroscope_bias_rad_s_),
                  gyro_.between(t, t + within, gyroscope_bias_rad_s_), within.seconds(), R_BX);
}

// From the time of the previous image, if there is one, to that of this one; X is a camera.
Mat3 FrontEnd::turn_since(const std::optional<HostStamp>& previous, const Mat3& R_BX, HostStamp image) const {
  if (!previous) return Mat3::Identity();
  const Mat3 R_B0B = gyro_.between(*previous + time_offset_, image + time_offset_, gyroscope_bias_rad_s_);
  return R_BX.transpose() * R_B0B.transpose() * R_BX;
}

// The body's velocity turns with the body since it was known. What a turn about the IMU adds to the camera's is left
// out: 1 mm for a camera 7 cm away, at 1 rad/s and 17 ms.
RigMotion FrontEnd::motion_of(const Mounted& first, const Mounted& second, HostStamp frame) const {
  const auto within = [](const Mounted& m) { return Span{std::abs(m.later.ns)} + m.half_readout; };
  const Span reach = std::max(within(first), within(second));
  if (reach == Span{}) return {};
  const Mat3 R_B0B = gyro_.between(known_.stamp, frame + time_offset_, gyroscope_bias_rad_s_);
  return {second.later.seconds(), turn_within(first.mount.R_BC, frame, reach),
          turn_within(second.mount.R_BC, frame + second.later, second.half_readout),
          first.mount.R_BC.transpose() * R_B0B.transpose() * vec3(known_.velocity_B_m_s)};
}

void FrontEnd::step(const Frame& image, const OtherFrames& others, TrackedFrame& out) noexcept {
  out.reasons = image.reasons;
  const bool blind = is_blind(image.reasons);
  for (OtherTracks& other : out.others) other.clear();
  if (blind) {
    out.stamp = image.stamp;
    out.sequence = image.sequence;
    out.features.clear();
  } else {
    const Mat3 R_CC0 = turn_since(first_.previous, first_.mount.R_BC, image.stamp);
    tracker_.step(image, R_CC0, out, turn_within(first_.mount.R_BC, image.stamp, first_.half_readout));
    first_.previous = image.stamp;
  }
  for (std::size_t number = 1; number <= kMostOthers; ++number)
    if (others_[number - 1])
      step_other(number, blind ? nullptr : &tracker_.pyramid(), image.stamp, others[number - 1], out);
}

/// `first`: the first camera's image, if it shows something.
void FrontEnd::step_other(std::size_t number, const PyramidView* first, HostStamp stamp, const Frame& image,
                          TrackedFrame& out) {
  Other& other = *others_[number - 1];
  const std::size_t beside = other.beside;
  const std::span<const TrackedFeature> tracks = beside == 0
                                                     ? std::span<const TrackedFeature>(out.features)
                                                     : std::span<const TrackedFeature>(out.others[beside - 1].alone);
  const PyramidView* const seen = beside == 0 ? first : others_[beside - 1]->tracker.pyramid();
  const Frame shown = is_blind(image.reasons) ? Frame{} : image;
  const HostStamp own = shown.data != nullptr ? shown.stamp : stamp;
  other.mounted.later = own - stamp;
  other.tracker.step(seen, tracks, shown, turn_since(other.mounted.previous, other.mounted.mount.R_BC, own),
                     out.others[number - 1], motion_of(camera(beside), other.mounted, stamp));
  other.mounted.previous = own;
}

}  // namespace epiline
