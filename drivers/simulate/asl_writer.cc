#include "drivers/simulate/asl_writer.h"

#include <fmt/format.h>
#include <fmt/os.h>

#include <Eigen/Geometry>
#include <system_error>

namespace epiline {
namespace {

void write_camera(const TrackSimulation& simulation, const SimulatedFlight& flight, fmt::ostream out) {
  const Mat3& R = flight.extrinsics.R_BC;
  const Vec3& p = flight.extrinsics.p_BC;
  out.print("sensor_type: camera\ncomment: simulated, flight {}, seed {}\n", to_string(simulation.flight),
            simulation.seed);
  out.print("T_BS:\n  cols: 4\n  rows: 4\n  data: [");
  for (int r = 0; r < 3; ++r) out.print("{}, {}, {}, {}, ", R(r, 0), R(r, 1), R(r, 2), p[r]);
  out.print("0, 0, 0, 1]\n");
  out.print("resolution: [{}, {}]\ncamera_model: pinhole\n", flight.width, flight.height);
  out.print("intrinsics: [{0}, {0}, {1}, {2}]\n", flight.focal_px, 0.5 * (flight.width - 1), 0.5 * (flight.height - 1));
  out.print("distortion_model: none\n");
}

void write_tracks(const SimulatedFlight& flight, fmt::ostream out) {
  out.print("#timestamp [ns],track_id,u [px],v [px]\n");
  for (const SimulatedImage& image : flight.images) {
    for (std::size_t i = image.begin; i < image.end; ++i) {
      const TrackObservation& o = flight.observations[i];
      out.print("{},{},{:.4f},{:.4f}\n", image.stamp.ns, o.id, o.pixel.x(), o.pixel.y());
    }
  }
}

void write_imu_noise(const ImuNoise& noise, fmt::ostream out) {
  out.print("sensor_type: imu\n");
  out.print("gyroscope_noise_density: {}\ngyroscope_random_walk: {}\n", noise.gyroscope_density,
            noise.gyroscope_random_walk);
  out.print("accelerometer_noise_density: {}\naccelerometer_random_walk: {}\n", noise.accelerometer_density,
            noise.accelerometer_random_walk);
}

void write_imu(const SimulatedFlight& flight, fmt::ostream out) {
  out.print("#timestamp [ns],w_x [rad s^-1],w_y,w_z,a_x [m s^-2],a_y,a_z\n");
  for (const ImuSample& s : flight.imu) {
    const auto& w = s.angular_velocity_rad_s;
    const auto& a = s.specific_force_m_s2;
    out.print("{},{},{},{},{},{},{}\n", s.stamp.ns, w[0], w[1], w[2], a[0], a[1], a[2]);
  }
}

void write_truth(const SimulatedFlight& flight, fmt::ostream out) {
  out.print("#timestamp [ns],p_x [m],p_y,p_z,q_w,q_x,q_y,q_z,v_x [m s^-1],v_y,v_z,bg_x,bg_y,bg_z,ba_x,ba_y,ba_z\n");
  for (const SimulatedImage& image : flight.images) {
    const BodyState& s = image.truth;
    const Eigen::Quaterniond q(s.R_WB);
    out.print("{},{},{},{},{},{},{},{}", image.stamp_true.ns, s.p_WB.x(), s.p_WB.y(), s.p_WB.z(), q.w(), q.x(), q.y(),
              q.z());
    for (const Vec3& v : {s.v_WB, s.b_g, s.b_a}) out.print(",{},{},{}", v.x(), v.y(), v.z());
    out.print("\n");
  }
}

}  // namespace

Status write_asl(const TrackSimulation& simulation, const SimulatedFlight& flight,
                 const std::filesystem::path& folder) {
  const std::filesystem::path root = folder / "mav0";
  std::error_code failed;
  for (const char* part : {"cam0", "imu0", "state_groundtruth_estimate0"}) {
    std::filesystem::create_directories(root / part, failed);
    if (failed) return Error{ErrorKind::kUsage, (root / part).string(), 0, failed.message(), "a folder to write to"};
  }
  try {
    write_camera(simulation, flight, fmt::output_file((root / "cam0/sensor.yaml").string()));
    write_tracks(flight, fmt::output_file((root / "cam0/tracks.csv").string()));
    write_imu_noise(simulation.imu.noise, fmt::output_file((root / "imu0/sensor.yaml").string()));
    write_imu(flight, fmt::output_file((root / "imu0/data.csv").string()));
    write_truth(flight, fmt::output_file((root / "state_groundtruth_estimate0/data.csv").string()));
  } catch (const std::system_error& e) {
    return Error{ErrorKind::kUsage, root.string(), 0, e.what(), "a folder to write to"};
  }
  return Done{};
}

}  // namespace epiline
