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

void FrontEnd::step(const Frame& image, const Frame& second, TrackedFrame& out) noexcept {
  out.reasons = image.reasons;
  if (is_blind(image.reasons)) {
    out.stamp = image.stamp;
    out.sequence = image.sequence;
    out.features.clear();
    out.second.clear();
    return;
  }
  Mat3 R_CC0 = Mat3::Identity();
  if (has_previous_) {
    const Mat3 R_B0B = gyro_.between(previous_ + time_offset_, image.stamp + time_offset_, bias_rad_s_);
    R_CC0 = R_BC_.transpose() * R_B0B.transpose() * R_BC_;
  }
  tracker_.step(image, R_CC0, out, rows_of(image.stamp + time_offset_));
  if (second_) second_->step(tracker_.pyramid(), second, out);
  previous_ = image.stamp;
  has_previous_ = true;
}

}  // namespace epiline
