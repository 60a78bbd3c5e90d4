#include "drivers/laboratory/simulate/asl_writer.h"

#include <Eigen/Geometry>

#include "pipeline/config/asl.h"
#include "pipeline/text/table.h"
#include "pipeline/text/text.h"

namespace epiline {
namespace fs = std::filesystem;

namespace {

Text tracks_text(const SimulatedFlight& flight) {
  Text out;
  out.print("{}", kAslTracksHeader);
  for (const SimulatedImage& image : flight.images) {
    for (std::size_t i = image.begin; i < image.end; ++i) {
      const TrackObservation& o = flight.observations[i];
      out.print("{},{},{:.4f},{:.4f}\n", image.stamp.ns, o.id, o.pixel.x(), o.pixel.y());
    }
  }
  return out;
}

template <class Rows, class Append>
std::string table(const char* header, const Rows& rows, Append append) {
  std::string out = header;
  for (const auto& row : rows) append(out, row);
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

/// No file without rows.
Status write_side(const fs::path& folder, const char* header, const std::string& text) {
  if (text == header) return Done{};
  if (Status s = make_folder(folder); !s) return s;
  return write_text(folder / "data.csv", text);
}

}  // namespace

Result<PartialFolder> make_asl_folder(const fs::path& folder, std::size_t other_cameras) {
  std::vector<std::string> folders = {"imu0", "state_groundtruth_estimate0"};
  for (std::size_t c = 0; c <= other_cameras; ++c) folders.push_back("cam" + std::to_string(c) + "/data");
  return PartialFolder::create(folder / "mav0", folders);
}

Status write_tables(const FlightTables& tables, const fs::path& root) {
  const auto write_camera = [&](std::size_t number, const CameraCalibration& camera) {
    return write_text(root / ("cam" + std::to_string(number)) / "sensor.yaml",
                      asl_camera(camera, tables.image_rate_hz, tables.comment));
  };
  if (Status s = write_camera(0, tables.camera); !s) return s;
  for (std::size_t i = 0; i < tables.other_cameras.size(); ++i)
    if (Status s = write_camera(i + 1, tables.other_cameras[i]); !s) return s;
  if (Status s = write_text(root / "imu0/sensor.yaml", asl_imu(tables.imu)); !s) return s;
  if (Status s = write_text(root / "imu0/data.csv", table(kAslImuHeader, tables.imu_samples, append_asl_imu)); !s)
    return s;
  const std::string wheel = table(kAslWheelHeader, tables.wheel_samples, append_asl_wheel);
  if (Status s = write_side(root / "wheel0", kAslWheelHeader, wheel); !s) return s;
  for (const AslHeightTable& heights : kAslHeightTables) {
    const auto of_kind = [&](std::string& out, const HeightSample& s) {
      if (s.kind == heights.kind) append_asl_height(out, s);
    };
    const std::string text = table(heights.header, tables.height_samples, of_kind);
    if (Status s = write_side(root / heights.folder, heights.header, text); !s) return s;
  }
  return write_text(root / "state_groundtruth_estimate0/data.csv", truth_text(tables.truth));
}

Status write_image_list(const std::vector<ImageRow>& rows, const fs::path& camera) {
  const auto append = [](std::string& out, const ImageRow& row) { append_asl_image(out, row.stamp, row.file); };
  return write_text(camera / "data.csv", table(kAslImagesHeader, rows, append));
}

Status write_asl(const TrackSimulation& simulation, const SimulatedFlight& flight, const fs::path& folder,
                 const std::vector<WheelSample>& wheel_samples, const std::vector<HeightSample>& height_samples) {
  auto made = make_asl_folder(folder);
  if (!made) return made.error();
  FlightTables tables;
  tables.comment = fmt::format("simulated, flight {}, seed {}", to_string(simulation.flight), simulation.seed);
  CameraParameters& camera = tables.camera.parameters;
  camera.width = flight.width;
  camera.height = flight.height;
  camera.intrinsics = {flight.focal_px, flight.focal_px, 0.5 * (flight.width - 1), 0.5 * (flight.height - 1)};
  camera.readout_s = flight.extrinsics.readout_s;
  tables.camera.R_BC = flight.extrinsics.R_BC;
  tables.camera.p_BC = flight.extrinsics.p_BC;
  tables.image_rate_hz = simulation.imu.rate_hz / simulation.imu_samples_per_image;
  tables.imu.noise = simulation.imu.noise;
  tables.imu_samples = flight.imu;
  tables.wheel_samples = wheel_samples;
  tables.height_samples = height_samples;
  for (const SimulatedImage& image : flight.images) tables.truth.push_back({image.stamp_true, image.truth});
  if (Status s = write_tables(tables, made->root()); !s) return s;
  if (Status s = write_text(made->root() / "cam0/tracks.csv", tracks_text(flight)); !s) return s;
  return made->finish();
}

}  // namespace epiline
