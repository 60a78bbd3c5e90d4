#include "estimator/factors/zero_motion.h"

namespace epiline {

namespace {
constexpr double kVelocityInformation = 1 / (kRestVelocitySigma * kRestVelocitySigma);
constexpr double kPositionInformation = 1 / (kRestPositionSigma * kRestPositionSigma);

double add_velocity(const Window& w, int k, NormalEquations* out) {
  const Vec3& v = w.at(k).x.v;
  if (out) {
    out->add(velocity_biases_of(k), Vec3(-kVelocityInformation * v));
    out->add(velocity_biases_of(k), velocity_biases_of(k), Mat3(kVelocityInformation * Mat3::Identity()));
  }
  return kVelocityInformation * v.squaredNorm();
}

double add_position(const Window& w, int k, int l, NormalEquations* out) {
  const Vec3 d = w.at(k).x.p - w.at(l).x.p;
  if (out) {
    const Mat3 H = kPositionInformation * Mat3::Identity();
    out->add(pose_of(k), Vec3(-kPositionInformation * d));
    out->add(pose_of(l), Vec3(kPositionInformation * d));
    out->add(pose_of(k), pose_of(k), H);
    out->add(pose_of(l), pose_of(l), H);
    out->add(pose_of(k), pose_of(l), Mat3(-H));
  }
  return kPositionInformation * d.squaredNorm();
}
}  // namespace

double add_zero_motion(const Window& w, const Share& share, NormalEquations* out) {
  double cost = 0;
  for (int k = 0; k < share.frames; ++k) {
    const Slot& s = w.at(k);
    if (!s.at_rest) continue;
    if (!share.oldest_only || k == 0) cost += add_velocity(w, k, out);
    const int l = s.rest_link ? w.index_of(s.rest_link) : -1;
    if (l >= 0 && (!share.oldest_only || l == 0)) cost += add_position(w, k, l, out);
  }
  return cost;
}

}  // namespace epiline
