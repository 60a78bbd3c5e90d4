#include "pipeline/stages/front_end.h"

#include <stdexcept>

namespace epiline {

std::optional<SecondRig> rig_of(const std::optional<CameraParameters>& second, const EstimatorConfig& estimator) {
  if (!second) return std::nullopt;
  const Mat3 R_SB = estimator.second.R_BC.transpose();
  return SecondRig{*second, R_SB * estimator.extrinsics.R_BC,
                   R_SB * (estimator.extrinsics.p_BC - estimator.second.p_BC)};
}

FrontEnd::FrontEnd(const Camera& camera, const TrackerConfig& config, const Mat3& R_BC,
                   const std::optional<SecondRig>& second)
    : tracker_(camera, config),
      R_BC_(R_BC),
      half_readout_(Span::from_seconds(0.5 * std::abs(camera.parameters().readout_s))) {
  if (!second) return;
  if (camera.parameters().readout_s != 0 || second->camera.readout_s != 0)
    throw std::invalid_argument("two cameras, of which one has a rolling shutter");
  second_.emplace(camera, *second, config);
  R_BS_ = R_BC * second->R_SC.transpose();
}

void FrontEnd::set_knowledge(const Vec3& gyroscope_bias_rad_s, double time_offset_s) noexcept {
  bias_rad_s_ = gyroscope_bias_rad_s;
  time_offset_ = Span::from_seconds(time_offset_s);
}

RowTurn FrontEnd::rows_of(HostStamp exposure) const {
  if (half_readout_ == Span{}) return {};
  return row_turn(gyro_.between(exposure - half_readout_, exposure, bias_rad_s_),
                  gyro_.between(exposure, exposure + half_readout_, bias_rad_s_), half_readout_.seconds(), R_BC_);
}

// From one time of an image to another; X is a camera.
Mat3 FrontEnd::turn_of(const Mat3& R_BX, HostStamp from, HostStamp to) const {
  const Mat3 R_B0B = gyro_.between(from + time_offset_, to + time_offset_, bias_rad_s_);
  return R_BX.transpose() * R_B0B.transpose() * R_BX;
}

void FrontEnd::step(const Frame& image, const Frame& second, TrackedFrame& out) noexcept {
  out.reasons = image.reasons;
  const bool blind = is_blind(image.reasons);
  if (blind) {
    out.stamp = image.stamp;
    out.sequence = image.sequence;
    out.features.clear();
    out.second.clear();
    out.second_tracks.clear();
  } else {
    const Mat3 R_CC0 = previous_ ? turn_of(R_BC_, *previous_, image.stamp) : Mat3(Mat3::Identity());
    tracker_.step(image, R_CC0, out, rows_of(image.stamp + time_offset_));
    previous_ = image.stamp;
  }
  if (!second_) return;
  const Frame shown = is_blind(second.reasons) ? Frame{} : second;
  const Mat3 R_SS0 = second_previous_ ? turn_of(R_BS_, *second_previous_, image.stamp) : Mat3(Mat3::Identity());
  second_->step(blind ? nullptr : &tracker_.pyramid(), shown, R_SS0, out);
  second_previous_ = image.stamp;
}

}  // namespace epiline
