#include "pipeline/config/asl.h"

#include <fmt/ranges.h>

#include <Eigen/LU>
#include <array>
#include <iterator>
#include <vector>

#include "pipeline/text/text.h"

namespace epiline {

namespace {

const char* model_of(CameraModel model) {
  if (model == CameraModel::kUnified) return "eucm";
  return model == CameraModel::kDoubleSphere ? "double-sphere" : "pinhole";
}

const char* distortion_of(CameraModel model) {
  if (model == CameraModel::kPinholeEquidistant) return "equidistant";
  return model == CameraModel::kDoubleSphere ? "none" : "radial-tangential";
}

}  // namespace

std::string asl_camera(const CameraCalibration& c, double image_rate_hz, const std::string& comment) {
  Text out;
  out.print("sensor_type: camera\ncomment: \"{}\"\n", comment);
  out.print("T_BS:\n  cols: 4\n  rows: 4\n  data: [");
  for (int r = 0; r < 3; ++r) out.print("{}, {}, {}, {}, ", c.R_BC(r, 0), c.R_BC(r, 1), c.R_BC(r, 2), c.p_BC[r]);
  out.print("0, 0, 0, 1]\n");
  const CameraParameters& p = c.parameters;
  out.print("rate_hz: {}\nresolution: [{}, {}]\ncamera_model: {}\n", image_rate_hz, p.width, p.height,
            model_of(p.model));
  const auto& d = p.distortion;
  // alpha with xi or beta stands before the focal lengths
  const bool sphere = p.model == CameraModel::kDoubleSphere, unified = p.model == CameraModel::kUnified;
  const int first = sphere || unified ? 2 : 0;
  std::vector<double> numbers(d.begin(), d.begin() + first);
  numbers.insert(numbers.end(), p.intrinsics.begin(), p.intrinsics.end());
  out.print("intrinsics: [{}]\ndistortion_model: {}\n", fmt::join(numbers, ", "), distortion_of(p.model));
  const bool fifth = p.model == CameraModel::kPinholeRadialTangential && d[4] != 0;
  if (!sphere)
    out.print("distortion_coefficients: [{}]\n",
              fmt::join(d.begin() + first, d.begin() + first + (fifth ? 5 : 4), ", "));
  out.print("timeshift_cam_imu: {}\n", c.time_offset_s);
  if (p.readout_s != 0) out.print("line_delay_nanoseconds: {}\n", 1e9 * p.readout_s / (p.height - 1));
  return out;
}

std::string asl_imu(const ImuCalibration& imu) {
  Text out;
  const ImuNoise& noise = imu.noise;
  out.print("sensor_type: imu\n");
  out.print("gyroscope_noise_density: {}\ngyroscope_random_walk: {}\n", noise.gyroscope_density,
            noise.gyroscope_random_walk);
  out.print("accelerometer_noise_density: {}\naccelerometer_random_walk: {}\n", noise.accelerometer_density,
            noise.accelerometer_random_walk);
  if (imu.saturation_gyroscope_rad_s) out.print("gyroscope_saturation: {}\n", *imu.saturation_gyroscope_rad_s);
  if (imu.saturation_accelerometer_m_s2)
    out.print("accelerometer_saturation: {}\n", *imu.saturation_accelerometer_m_s2);
  if (imu.correction.is_none()) return out;
  const Mat3 M = imu.correction.gyroscope.inverse();
  const auto rows = [](const Mat3& m) {
    return fmt::format(
        "[{}]",
        fmt::join(std::array{m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2)}, ", "));
  };
  out.print("accelerometers:\n  M: {}\ngyroscopes:\n  M: {}\n  A: {}\n", rows(imu.correction.accelerometer.inverse()),
            rows(M), rows(M * imu.correction.gyroscope_by_force));
  return out;
}

void append_asl_imu(std::string& text, const ImuSample& s) {
  const auto& w = s.angular_velocity_rad_s;
  const auto& a = s.specific_force_m_s2;
  fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{},{}\n", s.stamp.ns, w[0], w[1], w[2], a[0], a[1], a[2]);
}

void append_asl_wheel(std::string& text, const WheelSample& s) {
  fmt::format_to(std::back_inserter(text), "{},{}\n", s.stamp.ns, s.forward_speed_m_s);
}

void append_asl_height(std::string& text, const HeightSample& s) {
  fmt::format_to(std::back_inserter(text), "{},{}\n", s.stamp.ns, s.metres);
}

void append_asl_image(std::string& text, HostStamp stamp, const std::string& file) {
  fmt::format_to(std::back_inserter(text), "{},{}\n", stamp.ns, file);
}

}  // namespace epiline
