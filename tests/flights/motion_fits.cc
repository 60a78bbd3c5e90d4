// Recorded flights fitted one after the other: a table of how well each fitted motion agrees with its IMU and truth.
#include <fmt/format.h>

#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/laboratory/simulate/motion_fit.h"
#include "tests/flights/studies.h"

namespace epiline::motion_fits {
namespace {

constexpr double kDeg = 180 / std::numbers::pi;

constexpr const char* kHeader =
    "                        span   took gap max   |truth - motion| rms     constants              | residual | "
    "rotation, "
    "velocity, position over T against what noise predicts, and NEES\n"
    "                           s      s       s     mm  deg  out %  mount deg  lever mm  time ms  |  gyr   acc |";

double ratio(const Agreement& a) { return a.rms / a.predicted; }

std::string line(const std::string& name, const FitReport& r) {
  std::string text = fmt::format(
      "{:<22} {:>5.1f} {:>6.2f} {:>7.2f} {:>6.1f} {:>4.2f} {:>6.2f} {:>10.2f} {:>9.0f} {:>8.1f}  | {:>4.1f} {:>5.1f} |",
      name, r.duration_s, r.seconds, r.longest_gap_s, 1e3 * r.position_rms_m, kDeg * r.rotation_rms_rad,
      100 * r.distrusted_share, kDeg * r.mount_rad.norm(), 1e3 * r.p_BM.norm(), 1e3 * r.time_offset_s,
      ratio(r.samples.gyroscope), ratio(r.samples.accelerometer));
  for (const IntegratedAgreement& a : r.integrated) {
    text += fmt::format(" {} s: {:.2f} {:.2f} {:.2f} {:>4.2f} |", a.interval_s, ratio(a.rotation), ratio(a.velocity),
                        ratio(a.position), a.nees);
  }
  return text;
}

struct Options {
  std::vector<std::string> folders;
  std::string imu_calibration;
  FitSettings settings;
};

/// False, with a line on stderr, if there is nothing to fit.
bool fit_one(const std::string& folder, Options& o) {
  const auto complain = [](const std::string& what) {
    fmt::print(stderr, "epiline: error: {}\n", what);
    return false;
  };
  const auto flight = open_asl_motion(folder, o.imu_calibration);
  if (!flight) return complain(flight.error().text());
  if (!flight->ground_truth) return complain(folder + ": no ground truth");
  o.settings.imu_name = flight->imu_file.string();
  o.settings.truth_name = flight->truth_file.string();
  const auto fit = fit_motion(corrected_samples(*flight), flight->imu.noise, *flight->ground_truth, o.settings);
  if (!fit) return complain(fit.error().text());
  fmt::print("{}\n", line(std::filesystem::path(folder).filename().string(), fit->report));
  return true;
}

int run(Options& o) {
  fmt::print("{}\n", kHeader);
  bool good = true;
  for (const std::string& folder : o.folders) good = fit_one(folder, o) && good;
  return good ? 0 : 1;
}

std::function<int()> add(CLI::App& app) {
  static Options o;
  app.add_option("folders", o.folders, "ASL folders")->required();
  app.add_option("--imu-calibration", o.imu_calibration, "sensor.yaml to use instead of the folders' own");
  app.add_option("--knots", o.settings.knot_interval_s, "distance of knots, s; 0: two readings")->capture_default_str();
  app.add_option("--position-density", o.settings.position_density, "of the truth's noise, m/sqrt(Hz)")
      ->capture_default_str();
  app.add_option("--rotation-density", o.settings.rotation_density, "of the truth's noise, rad/sqrt(Hz)")
      ->capture_default_str();
  app.add_option("--draw", o.settings.draw, "seed: a random motion instead of the most probable one");
  return [] { return run(o); };
}
const StudyEntry kEntry("motion_fits", "Fits smooth motions to recorded flights and tabulates how well they agree",
                        add);

}  // namespace
}  // namespace epiline::motion_fits
