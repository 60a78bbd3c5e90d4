#include "drivers/study/calibrate/calibration_files.h"

#include <fmt/ranges.h>

#include "drivers/study/calibrate/lens_columns.h"
#include "drivers/study/report/stats_json.h"
#include "pipeline/text/table.h"
#include "pipeline/text/text.h"

namespace epiline {

namespace {

const char* kalibr_distortion(CameraModel model) {
  if (model == CameraModel::kPinholeRadialTangential) return "radtan";
  return model == CameraModel::kPinholeEquidistant ? "equidistant" : "none";
}

/// As the model lists them, in Kalibr's order.
std::vector<double> kalibr_intrinsics(const CameraParameters& lens) {
  std::vector<double> values(lens.intrinsics.begin(), lens.intrinsics.end());
  if (lens.model == CameraModel::kDoubleSphere)
    values.insert(values.begin(), lens.distortion.begin(), lens.distortion.begin() + 2);
  return values;
}

std::vector<double> kalibr_coefficients(const CameraParameters& lens) {
  if (lens.model == CameraModel::kDoubleSphere) return {};
  const bool fifth = lens.model == CameraModel::kPinholeRadialTangential && lens.distortion[4] != 0;
  return {lens.distortion.begin(), lens.distortion.begin() + (fifth ? 5 : 4)};
}

Json vector_json(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

Json matrix_json(const Mat3& R, const Vec3& p) {
  Json rows = Json::array();
  for (int r = 0; r < 3; ++r) rows.push_back({R(r, 0), R(r, 1), R(r, 2), p[r]});
  rows.push_back({0, 0, 0, 1});
  return rows;
}

Json camera_json(const Calibration& c) {
  const CameraParameters& lens = c.camera.parameters;
  const RigColumns columns(0, lens.model);
  const RigFit& fit = c.fit;
  Json sigma;
  for (int i = 0; i < lens_columns(lens.model); ++i) sigma[lens_column_name(lens.model, i)] = fit.sigma(i);
  sigma["rotation_rad"] = vector_json(fit.sigmas(columns.R_BC));
  sigma["translation_m"] = vector_json(fit.sigmas(columns.p_BC));
  sigma["timeshift_cam_imu"] = fit.sigma(columns.time_offset);
  return {{"model", name_of(lens.model)},
          {"resolution", {lens.width, lens.height}},
          {"intrinsics", kalibr_intrinsics(lens)},
          {"distortion_coeffs", kalibr_coefficients(lens)},
          {"T_cam_imu", matrix_json(c.camera.R_BC.transpose(), -c.camera.R_BC.transpose() * c.camera.p_BC)},
          {"T_imu_cam", matrix_json(c.camera.R_BC, c.camera.p_BC)},
          {"timeshift_cam_imu", c.camera.time_offset_s},
          {"rate_hz", c.image_rate_hz},
          {"lens_px", c.lens_px},
          {"covered", c.covered},
          {"sigma", std::move(sigma)}};
}

Json imu_json(const Calibration& c) {
  const RigConstants& found = c.fit.state.constants;
  const RigColumns columns(0, found.lens.model);
  return {{"rate_hz", c.imu_rate_hz},
          {"gyroscope_noise_density", c.imu.noise.gyroscope_density},
          {"accelerometer_noise_density", c.imu.noise.accelerometer_density},
          {"gyroscope_gain", vector_json(found.gyroscope_gain)},
          {"accelerometer_gain", vector_json(found.accelerometer_gain)},
          {"accelerometer_y_m", vector_json(found.accelerometers_B.col(1))},
          {"accelerometer_z_m", vector_json(found.accelerometers_B.col(2))},
          {"gyroscope_bias", vector_json(c.fit.state.gyroscope_bias.front())},
          {"accelerometer_bias", vector_json(c.fit.state.accelerometer_bias.front())},
          {"sigma",
           {{"gyroscope_gain", vector_json(c.fit.sigmas(columns.gyroscope_gain))},
            {"accelerometer_gain", vector_json(c.fit.sigmas(columns.accelerometer_gain))},
            {"accelerometer_y_m", vector_json(c.fit.sigmas(columns.accelerometer_y))},
            {"accelerometer_z_m", vector_json(c.fit.sigmas(columns.accelerometer_z))}}}};
}

}  // namespace

std::string kalibr_camera(const CameraCalibration& c, const std::string& name) {
  const Mat3 R_CB = c.R_BC.transpose();
  const Vec3 t_CB = -R_CB * c.p_BC;
  Text out;
  out.print("{}:\n  T_cam_imu:\n", name);
  for (int r = 0; r < 3; ++r) out.print("  - [{}, {}, {}, {}]\n", R_CB(r, 0), R_CB(r, 1), R_CB(r, 2), t_CB[r]);
  out.print("  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: {}\n",
            c.parameters.model == CameraModel::kDoubleSphere ? "ds" : "pinhole");
  out.print("  distortion_coeffs: [{}]\n  distortion_model: {}\n", fmt::join(kalibr_coefficients(c.parameters), ", "),
            kalibr_distortion(c.parameters.model));
  out.print("  intrinsics: [{}]\n", fmt::join(kalibr_intrinsics(c.parameters), ", "));
  out.print("  resolution: [{}, {}]\n  timeshift_cam_imu: {}\n", c.parameters.width, c.parameters.height,
            c.time_offset_s);
  return out;
}

std::string kalibr_imu(const ImuCalibration& imu, double rate_hz) {
  Text out;
  const ImuNoise& n = imu.noise;
  out.print("# Densities as measured while the rig was waved. Random walks as they were given, or usual ones.\n");
  out.print("accelerometer_noise_density: {}\naccelerometer_random_walk: {}\n", n.accelerometer_density,
            n.accelerometer_random_walk);
  out.print("gyroscope_noise_density: {}\ngyroscope_random_walk: {}\n", n.gyroscope_density, n.gyroscope_random_walk);
  if (imu.saturation_gyroscope_rad_s) out.print("gyroscope_saturation: {}\n", *imu.saturation_gyroscope_rad_s);
  if (imu.saturation_accelerometer_m_s2)
    out.print("accelerometer_saturation: {}\n", *imu.saturation_accelerometer_m_s2);
  out.print("update_rate: {:.1f}\n", rate_hz);
  return out;
}

std::string calibration_json(const Calibration& c, const CalibrateSettings& settings) {
  Json json = {{"schema", 1}, {"program", to_json(program_info())}, {"dataset", settings.dataset.string()}};
  json["good"] = c.good();
  json["camera"] = camera_json(c);
  json["imu"] = imu_json(c);
  json["corners"] = {{"images", c.fit.views},
                     {"count", c.fit.corners.size()},
                     {"outliers", c.fit.outliers},
                     {"rms_px", c.fit.rms_px},
                     {"sigma_px", c.fit.noise.corner_px}};
  json["seconds"] = c.fit.state.duration_s;
  Json verdicts = Json::array();
  for (const Verdict& v : c.verdicts) {
    verdicts.push_back({{"what", v.what},
                        {"good", v.good},
                        {"found", v.found},
                        {"advice", v.advice.empty() ? Json(nullptr) : Json(v.advice)}});
  }
  json["verdicts"] = std::move(verdicts);
  return json.dump(2) + "\n";
}

Status write_calibration(const Calibration& c, const CalibrateSettings& settings, const std::filesystem::path& folder) {
  if (const Status s = make_folder(folder); !s) return s;
  if (const Status s = write_text(folder / "camera.yaml", kalibr_camera(c.camera, settings.camera)); !s) return s;
  if (const Status s = write_text(folder / "imu.yaml", kalibr_imu(c.imu, c.imu_rate_hz)); !s) return s;
  if (const Status s = write_text(folder / "calibration.json", calibration_json(c, settings)); !s) return s;
  return write_text(folder / "report.html", calibration_html(c, settings));
}

}  // namespace epiline
