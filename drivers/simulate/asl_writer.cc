#include "drivers/simulate/asl_writer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <iterator>
#include <system_error>
#include <utility>

#include "pipeline/text/table.h"

namespace epiline {
namespace fs = std::filesystem;

namespace {

/// Text in the making.
class Text {
 public:
  template <class... T>
  void print(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<T>(values)...);
  }
  operator const std::string&() const { return text_; }  // NOLINT(google-explicit-constructor)

 private:
  std::string text_;
};

const char* model_of(CameraModel model) { return model == CameraModel::kDoubleSphere ? "double-sphere" : "pinhole"; }

const char* distortion_of(CameraModel model) {
  switch (model) {
    case CameraModel::kPinholeRadialTangential:
      return "radial-tangential";
    case CameraModel::kPinholeEquidistant:
      return "equidistant";
    case CameraModel::kDoubleSphere:
      return "none";
  }
  return "none";
}

Text camera_text(const FlightTables& tables) {
  Text out;
  const CameraCalibration& c = tables.camera;
  out.print("sensor_type: camera\ncomment: {}\n", tables.comment);
  out.print("T_BS:\n  cols: 4\n  rows: 4\n  data: [");
  for (int r = 0; r < 3; ++r) out.print("{}, {}, {}, {}, ", c.R_BC(r, 0), c.R_BC(r, 1), c.R_BC(r, 2), c.p_BC[r]);
  out.print("0, 0, 0, 1]\n");
  const CameraParameters& p = c.parameters;
  out.print("rate_hz: {}\nresolution: [{}, {}]\ncamera_model: {}\n", tables.image_rate_hz, p.width, p.height,
            model_of(p.model));
  const auto& d = p.distortion;
  if (p.model == CameraModel::kDoubleSphere) {
    out.print("intrinsics: [{}, {}, {}]\n", d[0], d[1], fmt::join(p.intrinsics, ", "));
  } else {
    out.print("intrinsics: [{}]\n", fmt::join(p.intrinsics, ", "));
  }
  out.print("distortion_model: {}\n", distortion_of(p.model));
  const bool fifth = p.model == CameraModel::kPinholeRadialTangential && d[4] != 0;
  if (p.model != CameraModel::kDoubleSphere)
    out.print("distortion_coefficients: [{}]\n", fmt::join(d.begin(), d.begin() + (fifth ? 5 : 4), ", "));
  out.print("timeshift_cam_imu: {}\n", c.time_offset_s);
  return out;
}

Text tracks_text(const SimulatedFlight& flight) {
  Text out;
  out.print("#timestamp [ns],track_id,u [px],v [px]\n");
  for (const SimulatedImage& image : flight.images) {
    for (std::size_t i = image.begin; i < image.end; ++i) {
      const TrackObservation& o = flight.observations[i];
      out.print("{},{},{:.4f},{:.4f}\n", image.stamp.ns, o.id, o.pixel.x(), o.pixel.y());
    }
  }
  return out;
}

Text imu_noise_text(const ImuCalibration& imu) {
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
  return out;
}

Text imu_text(const std::vector<ImuSample>& samples) {
  Text out;
  out.print("#timestamp [ns],w_x [rad s^-1],w_y,w_z,a_x [m s^-2],a_y,a_z\n");
  for (const ImuSample& s : samples) {
    const auto& w = s.angular_velocity_rad_s;
    const auto& a = s.specific_force_m_s2;
    out.print("{},{},{},{},{},{},{}\n", s.stamp.ns, w[0], w[1], w[2], a[0], a[1], a[2]);
  }
  return out;
}

Text truth_text(const std::vector<TruthRow>& rows) {
  Text out;
  out.print("#timestamp [ns],p_x [m],p_y,p_z,q_w,q_x,q_y,q_z,v_x [m s^-1],v_y,v_z,bg_x,bg_y,bg_z,ba_x,ba_y,ba_z\n");
  for (const auto& [stamp, s] : rows) {
    const Eigen::Quaterniond q(s.R_WB);
    out.print("{},{},{},{},{},{},{},{}", stamp.ns, s.p_WB.x(), s.p_WB.y(), s.p_WB.z(), q.w(), q.x(), q.y(), q.z());
    for (const Vec3& v : {s.v_WB, s.b_g, s.b_a}) out.print(",{},{},{}", v.x(), v.y(), v.z());
    out.print("\n");
  }
  return out;
}

}  // namespace

Result<AslFolder> AslFolder::create(const fs::path& folder) {
  AslFolder made(folder);
  std::error_code failed;
  fs::remove_all(made.root(), failed);
  for (const char* part : {"cam0/data", "imu0", "state_groundtruth_estimate0"}) {
    const fs::path path = made.root() / part;
    fs::create_directories(path, failed);
    if (failed) return Error{ErrorKind::kUsage, path.string(), 0, failed.message(), "a folder to write to"};
  }
  return made;
}

AslFolder::~AslFolder() {
  std::error_code ignored;
  if (!folder_.empty()) fs::remove_all(root(), ignored);
}

Status AslFolder::finish() {
  std::error_code failed;
  const fs::path final_name = folder_ / "mav0";
  fs::remove_all(final_name, failed);
  if (!failed) fs::rename(root(), final_name, failed);
  if (failed) return Error{ErrorKind::kUsage, final_name.string(), 0, failed.message(), "a folder to replace"};
  return Done{};
}

Status write_tables(const FlightTables& tables, const fs::path& root) {
  if (Status s = write_text(root / "cam0/sensor.yaml", camera_text(tables)); !s) return s;
  if (Status s = write_text(root / "imu0/sensor.yaml", imu_noise_text(tables.imu)); !s) return s;
  if (Status s = write_text(root / "imu0/data.csv", imu_text(tables.imu_samples)); !s) return s;
  return write_text(root / "state_groundtruth_estimate0/data.csv", truth_text(tables.truth));
}

Status write_image_list(const std::vector<ImageRow>& rows, const fs::path& root) {
  Text out;
  out.print("#timestamp [ns],filename\n");
  for (const ImageRow& row : rows) out.print("{},{}\n", row.stamp.ns, row.file);
  return write_text(root / "cam0/data.csv", out);
}

Status write_asl(const TrackSimulation& simulation, const SimulatedFlight& flight, const fs::path& folder) {
  auto made = AslFolder::create(folder);
  if (!made) return made.error();
  FlightTables tables;
  tables.comment = fmt::format("simulated, flight {}, seed {}", to_string(simulation.flight), simulation.seed);
  CameraParameters& camera = tables.camera.parameters;
  camera.width = flight.width;
  camera.height = flight.height;
  camera.intrinsics = {flight.focal_px, flight.focal_px, 0.5 * (flight.width - 1), 0.5 * (flight.height - 1)};
  tables.camera.R_BC = flight.extrinsics.R_BC;
  tables.camera.p_BC = flight.extrinsics.p_BC;
  tables.image_rate_hz = simulation.imu.rate_hz / simulation.imu_samples_per_image;
  tables.imu.noise = simulation.imu.noise;
  tables.imu_samples = flight.imu;
  for (const SimulatedImage& image : flight.images) tables.truth.push_back({image.stamp_true, image.truth});
  if (Status s = write_tables(tables, made->root()); !s) return s;
  if (Status s = write_text(made->root() / "cam0/tracks.csv", tracks_text(flight)); !s) return s;
  return made->finish();
}

}  // namespace epiline
