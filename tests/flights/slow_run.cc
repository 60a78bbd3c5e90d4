#include "tests/flights/slow_run.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "drivers/flights/motion/motion.h"
#include "drivers/flights/motion/spline.h"
#include "drivers/laboratory/simulate/imu_model.h"
#include "estimator/estimator.h"
#include "estimator/geometry/so3.h"

namespace epiline::test {
namespace {

constexpr double kLively_s = 15, kSettled_s = 1;  // the slow part begins a second after the lively one
constexpr double kInterval_s = 0.5;               // between two controls of the motion
constexpr double kFocal_px = 458, kHalfWidth_px = 370, kHalfHeight_px = 236;
constexpr int kTracks = 150, kSamplesPerImage = 10;
constexpr double kImage_s = 0.05;

enum Stream : std::uint64_t { kPathStream = 300, kImuStream, kPointStream };

/// Lively, and then steady.
class SlowPath final : public MotionModel {
 public:
  explicit SlowPath(const SlowFlight& f) : end_s_(kLively_s + kSettled_s + f.slow_s) {
    Random random(f.seed, kPathStream);
    const double angle = f.direction_deg * std::numbers::pi / 180;
    const Vec3 step = f.speed_m_s * kInterval_s * Vec3(std::cos(angle), std::sin(angle), 0);
    std::vector<Vec3> position, euler;
    Vec3 p = Vec3::Zero(), e = Vec3::Zero();
    for (double t = -kInterval_s; t < end_s_ + 4 * kInterval_s; t += kInterval_s) {
      if (t < kLively_s) {
        p = 0.7 * p + random.normal3(0.45);
        e = 0.8 * e + random.normal3(1).cwiseProduct(Vec3(0.08, 0.08, 0.15));
        if (t > kLively_s - 2 * kInterval_s) e.setZero();
      } else {
        p += step;
      }
      position.push_back(p);
      euler.push_back(e);
    }
    position_ = CubicSpline(kInterval_s, std::move(position));
    euler_ = CubicSpline(kInterval_s, std::move(euler));
  }
  double duration_s() const override { return end_s_; }
  Motion at(double t_s) const override {
    const CubicSpline::Value p = position_.at(t_s);
    constexpr double h = 1e-4;
    Motion m;
    m.p_WB = p.value;
    m.v_WB = p.first;
    m.a_WB = p.second;
    m.R_WB = attitude(t_s);
    m.omega_B = so3_log(attitude(t_s - h).transpose() * attitude(t_s + h)) / (2 * h);
    return m;
  }

 private:
  Mat3 attitude(double t_s) const {
    const Vec3 e = euler_.at(t_s).value;
    return so3_exp(Vec3(0, 0, e.z())) * so3_exp(Vec3(0, e.y(), 0)) * so3_exp(Vec3(e.x(), 0, 0));
  }
  double end_s_;
  CubicSpline position_, euler_;
};

Extrinsics camera() {
  Extrinsics e;
  e.R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  e.p_BC = Vec3(0.06, 0.02, -0.01);
  e.focal_px = kFocal_px;
  return e;
}

/// Tracks of points at 0.8 to 1 of the depth where they are first seen.
class Points {
 public:
  explicit Points(const SlowFlight& f) : f_(f), random_(f.seed, kPointStream) {}

  void image(const Motion& m, TrackedFrame& out) {
    const Extrinsics e = camera();
    const Mat3 R_WC = m.R_WB * e.R_BC;
    const Vec3 p_WC = m.p_WB + m.R_WB * e.p_BC;
    std::erase_if(tracks_, [&](const Track& t) {
      return !in_image(R_WC.transpose() * (t.point_W - p_WC)) || random_.chance(f_.loss_share);
    });
    for (Track& t : tracks_) {
      ++t.age;
      if (f_.error == TrackError::kDrift) t.drift += random_.normal2(f_.noise_px / std::sqrt(10.0));
    }
    while (tracks_.size() < kTracks) tracks_.push_back(begin(p_WC, R_WC));
    out.features.clear();
    for (const Track& t : tracks_) {
      Vec2 error = t.drift;
      if (f_.error == TrackError::kWhite) error = random_.normal2(f_.noise_px);
      out.features.push_back(seen(t, R_WC.transpose() * (t.point_W - p_WC), error));
    }
  }

 private:
  struct Track {
    std::uint32_t id, age;
    Vec3 point_W;
    Vec2 drift;
  };
  static bool in_image(const Vec3& X) {
    const Vec2 from_centre = kFocal_px * X.head<2>() / X.z();
    return X.z() > 0.1 && std::abs(from_centre.x()) < kHalfWidth_px && std::abs(from_centre.y()) < kHalfHeight_px;
  }
  Track begin(const Vec3& p_WC, const Mat3& R_WC) {
    const Vec3 ray(random_.uniform(-kHalfWidth_px, kHalfWidth_px) / kFocal_px,
                   random_.uniform(-kHalfHeight_px, kHalfHeight_px) / kFocal_px, 1);
    return {next_id_++, 0, p_WC + random_.uniform(0.8, 1) * f_.depth_m * (R_WC * ray), Vec2::Zero()};
  }
  static TrackedFeature seen(const Track& t, const Vec3& X, const Vec2& error_px) {
    TrackedFeature f;
    f.id = t.id;
    f.age = t.age;
    const Vec2 z = X.head<2>() / X.z() + error_px / kFocal_px;
    const Vec3 b = z.homogeneous().normalized();
    f.bearing = {b.x(), b.y(), b.z()};
    const double k = kFocal_px / b.z();
    f.pixel_jacobian = {k, 0, -k * z.x(), 0, k, -k * z.y()};
    return f;
  }

  const SlowFlight& f_;
  Random random_;
  std::vector<Track> tracks_;
  std::uint32_t next_id_ = 0;
};

}  // namespace

SlowVerdict fly_slowly(const SlowFlight& flight, const EstimatorConfig& settings) {
  const SlowPath path(flight);
  ImuModel model;
  ImuSimulator imu(model, Random(flight.seed, kImuStream));
  Points points(flight);
  EstimatorConfig config = settings;
  config.extrinsics = camera();
  config.imu = model.noise;
  Estimator estimator(config);
  Supervisor patient;
  const auto frame = std::make_unique<TrackedFrame>();

  SlowVerdict verdict;
  int frames = 0, tracking = 0, solved = 0;
  std::uint64_t rest_before = 0;
  Vec3 error_before = Vec3::Zero();
  bool slow_began = false;
  const auto stamp_at = [](int sample) { return HostStamp{} + Span::from_seconds(100 + 0.005 * sample); };
  const int samples = static_cast<int>((path.duration_s() + 1e-9) / 0.005);
  for (int k = 0; k < samples; ++k) {
    const double t = 0.005 * k;
    const Motion truth = path.at(t);
    const Vec3 b_a = imu.accelerometer_bias(), b_g = imu.gyroscope_bias();
    estimator.add_imu(imu.read(stamp_at(k), truth));
    if (k % kSamplesPerImage != 0) continue;
    points.image(truth, *frame);
    frame->stamp = stamp_at(k);
    if (k == 0) {
      InitialState start;
      start.p_WB = truth.p_WB;
      start.v_WB = truth.v_WB;
      start.R_WB = truth.R_WB;
      start.b_a = b_a;
      start.b_g = b_g;
      estimator.start(*frame, start);
      continue;
    }
    const StepResult step = estimator.process(*frame, patient);
    if (t < kLively_s + kSettled_s || !step.has_pose) continue;
    const Odometry& o = estimator.odometry();
    const Vec3 error = Vec3(o.p_WB_m.data()) - truth.p_WB;
    if (!slow_began) {
      slow_began = true;
      rest_before = estimator.stats().zero_motion_frames;
      error_before = error;
    }
    const Eigen::Map<const Eigen::Matrix<double, 16, 16>> covariance(o.covariance.data());
    const Eigen::SelfAdjointEigenSolver<Mat3> axes(Mat3(covariance.topLeftCorner<3, 3>()), Eigen::EigenvaluesOnly);
    ++frames;
    solved += step.solved;
    verdict.error_m = (error - error_before).norm();
    verdict.sigma_m = std::sqrt(axes.eigenvalues().z());
    if (o.health.state != HealthState::kTracking) continue;
    ++tracking;
    verdict.worst_ratio = std::max(verdict.worst_ratio, verdict.error_m / verdict.sigma_m);
  }
  verdict.rest_share = static_cast<double>(estimator.stats().zero_motion_frames - rest_before) / std::max(1, solved);
  verdict.tracking_share = frames * kImage_s / flight.slow_s * tracking / std::max(1, frames);
  verdict.resets = static_cast<int>(estimator.stats().resets);
  return verdict;
}

}  // namespace epiline::test
