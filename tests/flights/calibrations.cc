// How often a calibration's figures are within what it claims: waved rigs of every lens model, twenty seeds each.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "drivers/study/calibrate/board_detector.h"
#include "drivers/study/calibrate/calibrate.h"
#include "drivers/study/calibrate/lens_columns.h"
#include "drivers/study/calibrate/rig_fit.h"
#include "estimator/geometry/so3.h"
#include "pipeline/config/calibration.h"
#include "tests/drivers/study/calibrate/board_recording.h"
#include "tests/flights/studies.h"

namespace epiline::calibrations {
namespace {

struct Options {
  int seeds = 20, first = 1;
  double pixels = 0.15, seconds = 20;
  bool images = false;
  std::string only, write, camera;
};

WavedRig rig_with(CameraModel model, std::uint64_t seed) {
  WavedRig rig;
  rig.lens = lens_of(model);
  rig.seed = seed;
  rig.bend_m = 1e-3;
  if (model == CameraModel::kDoubleSphere) rig.distance_m = 0.3;
  if (model == CameraModel::kPinholeEquidistant) rig.distance_m = 0.35;
  return rig;
}

struct Figure {
  std::string name;
  double error, sigma;
};

std::vector<Figure> figures_of(const WavedRig& rig, const RigFit& fit) {
  const RigConstants& c = fit.state.constants;
  const RigColumns columns(0, rig.lens.model);
  std::vector<Figure> figures;
  const LensStep off = lens_values(c.lens) - lens_values(rig.lens);
  for (int i = 0; i < off.size(); ++i) figures.push_back({lens_column_name(rig.lens.model, i), off[i], fit.sigma(i)});
  const Vec3 turn = so3_log(rig.R_BC.transpose() * c.R_BC), place = c.p_BC - rig.p_BC;
  for (int i = 0; i < 3; ++i) {
    figures.push_back({fmt::format("rotation {}", i), turn[i], fit.sigma(columns.R_BC + i)});
    figures.push_back({fmt::format("place {}", i), place[i], fit.sigma(columns.p_BC + i)});
    figures.push_back({fmt::format("gyroscope {}", i), c.gyroscope_gain[i] - 1, fit.sigma(columns.gyroscope_gain + i)});
    figures.push_back(
        {fmt::format("accelerometer {}", i), c.accelerometer_gain[i] - 1, fit.sigma(columns.accelerometer_gain + i)});
    figures.push_back({fmt::format("y's accelerometer {}", i), c.accelerometers_B(i, 1) - rig.accelerometers_B(i, 1),
                       fit.sigma(columns.accelerometer_y + i)});
    figures.push_back({fmt::format("z's accelerometer {}", i), c.accelerometers_B(i, 2) - rig.accelerometers_B(i, 2),
                       fit.sigma(columns.accelerometer_z + i)});
  }
  figures.push_back({"time offset", c.time_offset_s - rig.time_offset_s, fit.sigma(columns.time_offset)});
  return figures;
}

/// What the detector finds in pictures of a flat board, ten a second.
Result<std::vector<CornerView>> views_in_images(const WavedRig& rig) {
  const AprilGrid grid = waved_grid();
  const auto boxes = black_boxes(grid);
  if (!boxes) return boxes.error();
  auto detector = BoardDetector::create(grid);
  if (!detector) return detector.error();
  const Photographer photographer(grid, *boxes, Camera(rig.lens));
  Random noise(rig.seed, 9);
  std::vector<CornerView> views;
  for (double t = 0.3; t < rig.seconds - 0.3; t += 0.1) {
    const WavedRig::Pose at = rig.pose(t);
    GreyImage image = photographer.take(at.R_TB * rig.R_BC, at.p_TB + at.R_TB * rig.p_BC);
    add_noise(image, noise);
    views.push_back({WavedRig::kBegin + Span::from_seconds(t - rig.time_offset_s),
                     detector->find({image.pixels.data(), image.width, image.height, image.width})});
  }
  return views;
}

/// What a user with EuRoC's camera would record, for trials of the whole way from parts to odometry.
int write_recording(const Options& o) {
  const auto camera = read_camera_calibration(o.camera, "cam0");
  if (!camera) {
    fmt::print(stderr, "{}\n", camera.error().text());
    return 1;
  }
  WavedRig rig;
  rig.lens = camera->parameters;
  rig.R_BC = camera->R_BC;
  rig.p_BC = camera->p_BC;
  rig.time_offset_s = 0;
  rig.seconds = o.seconds;
  const Status written = write_board_recording(rig, o.write);
  if (!written) fmt::print(stderr, "{}\n", written.error().text());
  return written ? 0 : 1;
}

Result<RigFit> calibrated(const WavedRig& rig, const std::vector<CornerView>& views) {
  const auto imu = rig.readings();
  const auto lens = fit_lens(views, rig.lens.model, rig.lens.width, rig.lens.height, std::nullopt);
  if (!lens) return lens.error();
  const auto alignment = align_turns(turns_of(views, *lens), imu);
  if (!alignment) return alignment.error();
  return fit_rig(views, *lens, *alignment, imu, {rig.imu.noise});
}

void study(CameraModel model, const Options& o) {
  std::vector<std::vector<double>> ratios;
  std::vector<std::string> names;
  int seeds_within = 0, done = 0;
  for (int seed = o.first; seed < o.first + o.seeds; ++seed) {
    WavedRig rig = rig_with(model, static_cast<std::uint64_t>(seed));
    rig.corner_px = o.pixels;
    const auto views = o.images ? views_in_images(rig) : rig.views();
    const auto fit = views ? calibrated(rig, *views) : Result<RigFit>(views.error());
    if (!fit) {
      fmt::print("{} seed {}: {}\n", name_of(model), seed, fit.error().text());
      continue;
    }
    ++done;
    const auto figures = figures_of(rig, *fit);
    ratios.resize(figures.size());
    names.resize(figures.size());
    bool is_within = true;
    for (std::size_t i = 0; i < figures.size(); ++i) {
      names[i] = figures[i].name;
      ratios[i].push_back(figures[i].error / figures[i].sigma);
      if (std::abs(ratios[i].back()) < 3) continue;
      is_within = false;
      fmt::print("  seed {}: {} is off by {:.1f} sigma\n", seed, names[i], ratios[i].back());
    }
    seeds_within += is_within;
  }
  fmt::print("{}: every figure within 3 sigma in {} of {} seeds ({} of {} fits done)\n", name_of(model), seeds_within,
             o.seeds, done, o.seeds);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto within = std::count_if(ratios[i].begin(), ratios[i].end(), [](double r) { return std::abs(r) < 3; });
    double sum = 0;
    for (const double r : ratios[i]) sum += r * r;
    fmt::print("  {:<16} within 3 sigma {:>3} of {}, rms {:.2f} sigma\n", names[i], within, ratios[i].size(),
               std::sqrt(sum / static_cast<double>(std::max<std::size_t>(ratios[i].size(), 1))));
  }
}

int run(const Options& o) {
  if (!o.write.empty()) return write_recording(o);
  for (const auto model :
       {CameraModel::kPinholeRadialTangential, CameraModel::kPinholeEquidistant, CameraModel::kDoubleSphere})
    if (o.only.empty() || o.only == name_of(model)) study(model, o);
  return 0;
}

std::function<int()> add(CLI::App& app) {
  static Options o;
  app.add_option("--seeds", o.seeds, "rigs of each lens model")->capture_default_str();
  app.add_option("--first", o.first, "the first seed")->capture_default_str();
  app.add_option("--pixels", o.pixels, "noise of a corner, px")->capture_default_str();
  app.add_flag("--images", o.images, "corners found in rendered images of a flat board, in place of simulated ones");
  app.add_option("--model", o.only, "this lens model only: radial-tangential, equidistant, double-sphere");
  app.add_option("--write", o.write, "write a recording of a waved board into this folder instead");
  app.add_option("--camera", o.camera, "with --write: calibration of the camera");
  app.add_option("--seconds", o.seconds, "with --write: of the recording");
  return [] { return run(o); };
}
const StudyEntry kEntry("calibrations",
                        "Calibrations of waved rigs, and how often their figures are within what they claim", add);

}  // namespace
}  // namespace epiline::calibrations
