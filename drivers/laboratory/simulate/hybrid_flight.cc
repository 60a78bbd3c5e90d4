#include "drivers/laboratory/simulate/hybrid_flight.h"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/laboratory/simulate/motion_fit.h"

namespace epiline {
namespace {

constexpr double kMargin_s = 0.1;    ///< of IMU before the first and after the last image
constexpr double kWidestRoom_m = 9;  ///< a flight that extends further takes place in a hall

Result<CameraCalibration> camera_of(const HybridSettings& settings, const std::filesystem::path& root) {
  const auto own = root / "cam0/sensor.yaml";
  if (settings.camera_file.empty() && !std::filesystem::exists(own))
    return Error{ErrorKind::kUsage, own.string(), 0, "does not exist", "a camera: --camera sensor.yaml"};
  return read_camera_calibration(settings.camera_file.empty() ? own : settings.camera_file, "cam0");
}

BodyState state_at(const FittedMotion& motion, double t_s) {
  const Motion m = motion.at(t_s);
  return {m.p_WB, m.v_WB, m.R_WB, motion.accelerometer_bias(t_s), motion.gyroscope_bias(t_s)};
}

/// The truth at every recorded reading that the motion covers.
std::vector<TruthRow> truth_rows(const FittedMotion& motion, const std::vector<ImuSample>& readings) {
  std::vector<TruthRow> rows;
  for (const ImuSample& s : readings) {
    const double t = motion.seconds(s.stamp);
    if (t >= 0 && t <= motion.duration_s()) rows.push_back({s.stamp, state_at(motion, t)});
  }
  return rows;
}

void simulate_imu(const FittedMotion& motion, const HybridSettings& settings, FlightTables& tables) {
  const auto& readings = tables.imu_samples;
  const double seconds = (readings.back().stamp - readings.front().stamp).seconds();
  const double rate_hz = static_cast<double>(readings.size() - 1) / seconds;
  ImuSimulator simulator(imu_model_with(settings.imu_effects, tables.imu.noise, rate_hz, Random(settings.seed, 711)),
                         Random(settings.seed, 710));
  tables.imu_samples.clear();
  tables.imu.correction = {};
  for (TruthRow& row : tables.truth) {
    row.state.b_a = simulator.accelerometer_bias();
    row.state.b_g = simulator.gyroscope_bias();
    tables.imu_samples.push_back(simulator.read(row.stamp, motion.at(motion.seconds(row.stamp))));
  }
}

double extent_m(const std::vector<TruthRow>& truth) {
  Vec3 low = truth.front().state.p_WB, high = low;
  for (const TruthRow& row : truth) {
    low = low.cwiseMin(row.state.p_WB);
    high = high.cwiseMax(row.state.p_WB);
  }
  return (high - low).head<2>().maxCoeff();
}

}  // namespace

Result<HybridFlight> hybrid_flight(const HybridSettings& settings) {
  auto recorded = open_asl_motion(settings.dataset, settings.imu_calibration);
  if (!recorded) return recorded.error();
  const auto camera = camera_of(settings, recorded->root);
  if (!camera) return camera.error();
  if (!recorded->ground_truth)
    return Error{ErrorKind::kUsage, (recorded->root / "state_groundtruth_estimate0/data.csv").string(), 0,
                 "does not exist", "the ground truth, to render from"};
  FitSettings fit_settings;
  fit_settings.draw = settings.seed;
  fit_settings.imu_name = recorded->imu_file.string();
  fit_settings.truth_name = recorded->truth_file.string();
  const auto fit = fit_motion(corrected_samples(*recorded), recorded->imu.noise, *recorded->ground_truth, fit_settings);
  if (!fit) return fit.error();
  const FittedMotion& motion = fit->motion;

  HybridFlight result{.flight = {}, .fit = fit->report, .usual_world = WorldKind::kRoom};
  FlightToRender& flight = result.flight;
  flight.begin = motion.begin();
  flight.from_s = kMargin_s;
  flight.to_s = motion.duration_s() - kMargin_s;
  flight.tables.comment =
      fmt::format("rendered along {}, seed {}", settings.dataset.filename().string(), settings.seed);
  flight.tables.camera = *camera;
  flight.tables.image_rate_hz = settings.image_rate_hz;
  flight.tables.imu = recorded->imu;
  flight.tables.truth = truth_rows(motion, recorded->imu_samples);
  flight.tables.imu_samples = std::move(recorded->imu_samples);
  if (settings.simulated_imu) simulate_imu(motion, settings, flight.tables);
  if (extent_m(flight.tables.truth) > kWidestRoom_m) result.usual_world = WorldKind::kHall;
  flight.motion = std::make_unique<FittedMotion>(motion);
  return result;
}

}  // namespace epiline
