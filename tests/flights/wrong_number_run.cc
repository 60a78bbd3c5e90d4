#include "tests/flights/wrong_number_run.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <utility>

#include "pipeline/text/suspicion_text.h"

namespace epiline::test {

namespace {

constexpr double kDegree = std::numbers::pi / 180;

void turn(AslDataset& d, const Vec3& axis_C, double degrees) {
  d.camera.R_BC = d.camera.R_BC * Eigen::AngleAxisd(degrees * kDegree, axis_C).toRotationMatrix();
}

void shift_images(AslDataset& d, double by_s) {
  const Span by = Span::from_seconds(by_s);
  for (ImageFile& image : d.images) image.stamp = image.stamp + by;
  for (TrackInstant& instant : d.instants) instant.stamp = instant.stamp + by;
}

using Triple = std::array<double, 3>;

void each_reading(AslDataset& d, const std::function<void(Triple& rate, Triple& force)>& change) {
  for (ImuSample& r : d.imu_samples) change(r.angular_velocity_rad_s, r.specific_force_m_s2);
}

std::vector<WrongNumber> list() {
  std::vector<WrongNumber> l;
  const auto add = [&](std::string name, bool gross, std::function<void(AslDataset&)> apply) {
    l.push_back({std::move(name), std::move(apply), gross});
  };
  add("nothing", false, [](AslDataset&) {});
  const char* axes = "xyz";
  for (const double degrees : {1., 2., 5., 10., 20., 90.})
    for (int axis = 0; axis < 3; ++axis)
      add(fmt::format("camera turned {:g} deg about {}", degrees, axes[axis]), degrees >= 10,
          [=](AslDataset& d) { turn(d, Vec3::Unit(axis), degrees); });
  add("image turned 180 deg", true, [](AslDataset& d) { turn(d, Vec3::UnitZ(), 180); });
  add("T_cam_imu inverted", true, [](AslDataset& d) {
    d.camera.R_BC.transposeInPlace();
    d.camera.p_BC = -(d.camera.R_BC * d.camera.p_BC);
  });
  for (const double metres : {0.02, 0.05, 0.2})
    for (int axis = 0; axis < 3; ++axis)
      add(fmt::format("lever arm + {:g} m in {}", metres, axes[axis]), false,
          [=](AslDataset& d) { d.camera.p_BC[axis] += metres; });
  for (const double percent : {-20., -5., -2., -1., 1., 2., 5., 20.})
    add(fmt::format("focal length {:+g} %", percent), std::abs(percent) >= 20, [=](AslDataset& d) {
      for (const std::size_t i : {0U, 1U}) d.camera.parameters.intrinsics[i] *= 1 + percent / 100;
    });
  add("no distortion", false, [](AslDataset& d) { d.camera.parameters.distortion = {}; });
  for (const double factor : {0.01, 0.1, 10., 100.}) {
    const auto gyroscope = [=](AslDataset& d) {
      d.imu.noise.gyroscope_density *= factor;
      d.imu.noise.gyroscope_random_walk *= factor;
    };
    const auto accelerometer = [=](AslDataset& d) {
      d.imu.noise.accelerometer_density *= factor;
      d.imu.noise.accelerometer_random_walk *= factor;
    };
    add(fmt::format("densities x {:g}", factor), false, [=](AslDataset& d) {
      gyroscope(d);
      accelerometer(d);
    });
    add(fmt::format("gyroscope densities x {:g}", factor), false, gyroscope);
    add(fmt::format("accelerometer densities x {:g}", factor), false, accelerometer);
  }
  for (const double ms : {-100., -50., -20., -10., -5., 5., 10., 20., 50., 100.})
    add(fmt::format("image stamps {:+g} ms", ms), std::abs(ms) >= 50,
        [=](AslDataset& d) { shift_images(d, ms / 1e3); });
  add("gyroscope in degrees", true, [](AslDataset& d) {
    each_reading(d, [](Triple& w, Triple&) {
      for (double& v : w) v /= kDegree;
    });
  });
  add("accelerometer in g", true, [](AslDataset& d) {
    each_reading(d, [](Triple&, Triple& a) {
      for (double& v : a) v /= 9.80665;
    });
  });
  for (const double percent : {3., 10.}) {
    add(fmt::format("gyroscope + {:g} %", percent), false, [=](AslDataset& d) {
      each_reading(d, [=](Triple& w, Triple&) {
        for (double& v : w) v *= 1 + percent / 100;
      });
    });
    add(fmt::format("accelerometer + {:g} %", percent), false, [=](AslDataset& d) {
      each_reading(d, [=](Triple&, Triple& a) {
        for (double& v : a) v *= 1 + percent / 100;
      });
    });
  }
  add("axes x and y swapped", true, [](AslDataset& d) {
    each_reading(d, [](Triple& w, Triple& a) {
      std::swap(w[0], w[1]);
      std::swap(a[0], a[1]);
    });
  });
  add("sign of gyroscope's z", true, [](AslDataset& d) { each_reading(d, [](Triple& w, Triple&) { w[2] = -w[2]; }); });
  add("sign of gyroscope's x", true, [](AslDataset& d) { each_reading(d, [](Triple& w, Triple&) { w[0] = -w[0]; }); });
  add("sign of accelerometer's x", true,
      [](AslDataset& d) { each_reading(d, [](Triple&, Triple& a) { a[0] = -a[0]; }); });
  add("sign of both z", true, [](AslDataset& d) {
    each_reading(d, [](Triple& w, Triple& a) {
      w[2] = -w[2];
      a[2] = -a[2];
    });
  });
  add("accelerometer bias 1.4 m/s^2", false,
      [](AslDataset& d) { each_reading(d, [](Triple&, Triple& a) { a[0] += 1.4; }); });
  // the readings of another part of the flight: the second half comes first
  add("image and IMU of different flights", true, [](AslDataset& d) {
    auto& readings = d.imu_samples;
    const std::vector<ImuSample> original = readings;
    for (std::size_t i = 0; i < readings.size(); ++i) {
      const ImuSample& other = original[(i + original.size() / 2) % original.size()];
      readings[i].angular_velocity_rad_s = other.angular_velocity_rad_s;
      readings[i].specific_force_m_s2 = other.specific_force_m_s2;
    }
  });
  return l;
}

}  // namespace

const std::vector<WrongNumber>& wrong_numbers() {
  static const std::vector<WrongNumber> all = list();
  return all;
}

WrongNumberVerdict fly_with_wrong_number(ReplayOptions options, const WrongNumber& wrong) {
  constexpr double kFree_s = 3;
  WrongNumberVerdict v;
  PublishedOdometry published(200'000);
  HostStamp zero;
  options.odometry = &published;
  options.alter = [&](AslDataset& d) {
    wrong.apply(d);
    zero = d.instant(0);
  };
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result || !result->record.truth || result->record.images.empty()) return v;
  const FlightRecord& record = result->record;
  v.ran = true;
  for (const ImageRecord& image : record.images) v.reasons |= image.health.reasons;
  v.suspects = texts_of(record.estimator.suspicions);
  if (published.all().empty()) return v;
  const auto errors = errors_of(record);
  if (errors && errors->poses > 0) {
    v.ate_m = errors->ate_4dof.rmse;
    v.nees = errors->nees;
  }
  const double first_s = (published.all().front().stamp - zero).seconds();
  const FaultVerdict judged =
      judge(published.all(), *record.truth, zero, {first_s + kFree_s, first_s + kFree_s, first_s + kFree_s},
            record.estimator.origins);
  std::size_t tracking = 0, later = 0;
  for (const Odometry& o : published.all()) {
    tracking += o.health.state == HealthState::kTracking;
    later += o.health.state == HealthState::kTracking && (o.stamp - zero).seconds() >= first_s + kFree_s;
  }
  v.tracking_share = static_cast<double>(tracking) / static_cast<double>(published.all().size());
  v.wrong_share = later > 0 ? static_cast<double>(judged.wrong) / static_cast<double>(later) : 0;
  v.worst_ratio = judged.worst_ratio;
  v.resets = static_cast<std::uint32_t>(record.estimator.resets);
  return v;
}

}  // namespace epiline::test
