#include "drivers/program/hil/played_truth.h"

#include <algorithm>
#include <iterator>

namespace epiline::hil {

namespace {
constexpr Span kGap = Span::from_milliseconds(100);
constexpr Span kBaseline = Span::from_milliseconds(20);  // for velocities the recording does not have
}  // namespace

std::optional<TruthState> PlayedTruth::at(HostStamp recorded) const {
  if (truth_ == nullptr) return std::nullopt;
  const auto later = std::lower_bound(truth_->poses.begin(), truth_->poses.end(), recorded,
                                      [](const TimedPose& pose, HostStamp stamp) { return pose.stamp < stamp; });
  if (later == truth_->poses.begin() || later == truth_->poses.end()) return std::nullopt;
  auto after = static_cast<std::size_t>(later - truth_->poses.begin()), before = after - 1;
  const TimedPose &a = truth_->poses[before], &b = truth_->poses[after];
  if (b.stamp - a.stamp > kGap) return std::nullopt;
  const double share = (recorded - a.stamp).seconds() / (b.stamp - a.stamp).seconds();
  TruthState state;
  state.p_WB = a.p_WB + share * (b.p_WB - a.p_WB);
  state.R_WB = a.q_WB.slerp(share, b.q_WB).toRotationMatrix();
  if (!truth_->v_WB_m_s.empty()) {
    state.v_WB = truth_->v_WB_m_s[before] + share * (truth_->v_WB_m_s[after] - truth_->v_WB_m_s[before]);
    return state;
  }
  while (before > 0 && recorded - truth_->poses[before].stamp < kBaseline) --before;
  while (after + 1 < truth_->poses.size() && truth_->poses[after].stamp - recorded < kBaseline) ++after;
  const TimedPose &first = truth_->poses[before], &last = truth_->poses[after];
  state.v_WB = (last.p_WB - first.p_WB) / (last.stamp - first.stamp).seconds();
  return state;
}

Trajectory played(const Trajectory& truth, const Pace& pace) {
  Trajectory moved = truth;
  for (TimedPose& pose : moved.poses) pose.stamp.ns = pace.host_of(pose.stamp);
  return moved;
}

}  // namespace epiline::hil
