#include "tests/estimator/synthetic_window.h"

#include <random>

namespace epiline {

SyntheticWindow make_window(const SyntheticOptions& o) {
  SyntheticWindow s;
  s.window = std::make_unique<Window>(kMaxFrames);
  Window& w = *s.window;
  w.calibration = synthetic_calibration(o.lever);
  const RigPose rig = synthetic_rig().poses[1];
  if (o.second) w.rig = synthetic_rig();
  if (o.moved) {
    w.calibration.p_BC += w.calibration.R_BC * rig.p_CD;
    w.calibration.R_BC = w.calibration.R_BC * rig.R_CD;
  }
  std::mt19937_64 random(o.seed);
  std::normal_distribution<double> normal;
  auto noise3 = [&](double sigma) {
    return Vec3(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  const SyntheticPath path{o.motion};
  const double interval = 0.1, imu_dt = 0.005;
  std::vector<Vec3> points;
  const Calibration c = synthetic_calibration(o.lever);
  const Mat3 R_mid = path.R(0.05 * o.frames) * c.R_BC;
  for (int i = 0; i < o.tracks; ++i) {
    const Vec3 ray(0.9 * std::uniform_real_distribution<double>(-0.6, 0.6)(random),
                   std::uniform_real_distribution<double>(-0.4, 0.4)(random), 1);
    points.push_back(path.p(0.05 * o.frames) + R_mid * (ray * std::uniform_real_distribution<double>(2.5, 9)(random)));
  }
  for (int k = 0; k < o.frames; ++k) {
    const double t = k * interval;
    Slot& slot = w.append();
    slot.image_stamp = slot.time = HostStamp{static_cast<std::int64_t>(k) * 100'000'000};
    slot.x.p = path.p(t);
    slot.x.v = path.v(t);
    slot.x.R = path.R(t);
    slot.omega = path.w(t);
    s.truth.push_back(slot.x);
    if (k > 0) {
      slot.imu.reset(Vec3::Zero(), Vec3::Zero());
      for (int i = 0; i < 20; ++i) {
        const double t0 = t - interval + i * imu_dt, t1 = t0 + imu_dt;
        auto force = [&](double q) { return Vec3(path.R(q).transpose() * (path.a(q) - kGravity_W)); };
        const double by_w = 1 / (1 + o.imu_scale.gyroscope), by_a = 1 / (1 + o.imu_scale.accelerometer);
        slot.imu.integrate(by_w * path.w(t0), by_a * force(t0), by_w * path.w(t1), by_a * force(t1), imu_dt,
                           ImuNoise{});
      }
      whiten(slot);
    }
    static TrackedFrame frame;
    frame.features.clear();
    OtherTracks& second = frame.others[0];
    second.clear();
    frame.stamp = slot.image_stamp;
    auto in_camera = [&](const Vec3& P, double q) {
      const Mat3 R_WC = path.R(q) * c.R_BC;
      return Vec3(R_WC.transpose() * (P - path.p(q) - path.R(q) * c.p_BC));
    };
    for (int i = 0; i < o.tracks; ++i) {
      if ((i + k) % 5 == 4 && i % 2) continue;  // holes in the tracks
      const double exposed = t + o.time_offset;
      double row_s = 0;
      const auto seen = [&] { return in_camera(points[static_cast<std::size_t>(i)], exposed + row_s); };
      Vec3 X = seen();
      if (X.z() < 0.3) continue;
      for (int n = 0; n < 20 && o.readout_s != 0; ++n) {
        row_s = o.readout_s / 480 * kFocal * X.y() / X.z();
        X = seen();
      }
      // as if seen at the stamp, by the attitude alone
      if (row_s != 0) X = c.R_BC.transpose() * path.R(exposed).transpose() * path.R(exposed + row_s) * c.R_BC * X;
      Vec3 X_D = rig.R_CD.transpose() * (X - rig.p_CD);
      if (o.second_later != 0) {
        const double later = exposed + o.second_later;
        const Mat3 R_WD = path.R(exposed) * c.R_BC * rig.R_CD, R_WD_later = path.R(later) * c.R_BC * rig.R_CD;
        const Vec3 X_later = in_camera(points[static_cast<std::size_t>(i)], later);
        X_D = R_WD.transpose() * R_WD_later * rig.R_CD.transpose() * (X_later - rig.p_CD);
      }
      const auto id = static_cast<std::uint32_t>(i);
      const Vec2 noise_px(o.pixel_noise * normal(random), o.pixel_noise * normal(random));
      const bool alone = o.alone && i % 4 == 2;
      if (alone) {
        second.alone.push_back(make_feature(first_track_of(1) | id, X_D, noise_px));
        second.alone.back().row_s = static_cast<float>(o.second_later);
      }
      if (alone || (o.only_alone && i % 4 != 2)) continue;
      frame.features.push_back(make_feature(id, o.moved ? X_D : X, noise_px));
      if (o.fisheye) through_fisheye(frame.features.back());
      frame.features.back().row_s = static_cast<float>(row_s);
      if (!o.second || i % 4 == 3) continue;
      const auto age = [&](int n) { return static_cast<std::uint32_t>(3 + i % 5 + 2 * n + n % 2); };
      const bool anew = o.found_anew > 0 && k >= o.found_anew;
      frame.features.back().age = age(k);
      second.views.push_back(make_second_view(
          static_cast<std::uint32_t>(i), X_D, Vec2(o.pixel_noise * normal(random), o.pixel_noise * normal(random)),
          age(k), anew ? age(o.found_anew) - 1 : static_cast<std::uint32_t>(i % 4)));
      second.views.back().row_s = static_cast<float>(o.second_later);
    }
    w.observe(frame);
  }
  for (int k = 0; k < o.frames; ++k) {
    Vec6 dp;
    dp << noise3(o.state_error), noise3(0.3 * o.state_error);
    Vec9 dv;
    dv << noise3(o.state_error), noise3(o.state_error), noise3(0.1 * o.state_error);
    retract_pose(w.at(k).x, dp);
    retract_velocity_biases(w.at(k).x, dv);
  }
  return s;
}

}  // namespace epiline
