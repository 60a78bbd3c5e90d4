#include "drivers/study/calibrate/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "drivers/flights/motion/readings.h"
#include "drivers/flights/recordings/image_source.h"
#include "drivers/study/calibrate/board.h"
#include "drivers/study/calibrate/board_detector.h"
#include "drivers/study/calibrate/lens_columns.h"

namespace epiline {

namespace fs = std::filesystem;

namespace {

Result<std::optional<CameraCalibration>> read_guess(const CalibrateSettings& settings, const AslDataset& dataset) {
  if (settings.guess == "none") return std::optional<CameraCalibration>{};
  fs::path path = settings.guess;
  if (path.empty()) {
    path = dataset.root / settings.camera / "sensor.yaml";
    std::error_code ignored;
    if (!fs::exists(path, ignored) || holds_no_calibration(path)) return std::optional<CameraCalibration>{};
  }
  auto guess = read_camera_calibration(path, settings.camera);
  if (!guess) return guess.error();
  if (guess->parameters.model == CameraModel::kUnified)
    return Error{ErrorKind::kUsage, path.string(), 0, "a lens of Mei or EUCM, which is not fitted",
                 "--guess none, or a guess of another model"};
  return std::optional<CameraCalibration>{std::move(*guess)};
}

Result<std::vector<CornerView>> corners_of_tracks(const CalibrateSettings& settings, const AslDataset& dataset) {
  const auto target = read_target(settings.board.empty() ? dataset.root / "target.csv" : settings.board);
  if (!target) return target.error();
  return views_of(dataset, *target);
}

GreyPixels pixels_of(const GreyImage& image) { return {image.pixels.data(), image.width, image.height, image.width}; }

/// In how many of 20 images a board shows that only a mirror could have put there: tags have no mirror image.
int seen_mirrored(BoardDetector& detector, const AslDataset& dataset) {
  int count = 0;
  GreyImage image;
  const std::size_t step = std::max<std::size_t>(1, dataset.images.size() / 20);
  for (std::size_t i = 0; i < dataset.images.size(); i += step) {
    if (!dataset.image_source->read(i, image)) continue;
    for (int y = 0; y < image.height; ++y) std::reverse(image.row(y), image.row(y) + image.width);
    count += detector.find(pixels_of(image)).empty() ? 0 : 1;
  }
  return count;
}

Result<std::vector<CornerView>> corners_of_images(const CalibrateSettings& settings, const AslDataset& dataset) {
  if (settings.board.empty()) {
    return Error{ErrorKind::kUsage, "", 0, "no board",
                 "--board FILE, the description of an AprilGrid or a ChArUco board (epiline board writes one)"};
  }
  const auto board = read_board(settings.board);
  if (!board) return board.error();
  auto detector = BoardDetector::create(*board);
  if (!detector) return detector.error();
  std::vector<CornerView> views;
  GreyImage image;
  for (std::size_t i = 0; i < dataset.images.size(); ++i) {
    if (const Status s = dataset.image_source->read(i, image); !s) return s.error();
    if (!views.empty() && dataset.images[i].stamp <= views.back().stamp) continue;
    views.push_back({dataset.images[i].stamp, detector->find(pixels_of(image))});
  }
  const bool none = std::all_of(views.begin(), views.end(), [](const CornerView& v) { return v.corners.empty(); });
  if (none && seen_mirrored(*detector, dataset) > 0)
    return Error{ErrorKind::kUsage, dataset.root.string(), 0,
                 "the images are mirrored: no tag is found but in a mirror",
                 "images as they are seen; camera drivers call it horizontal flip"};
  return views;
}

/// The part of the recording that was asked for.
Result<std::vector<CornerView>> read_views(const CalibrateSettings& settings, const AslDataset& dataset) {
  auto read = dataset.images.empty() ? corners_of_tracks(settings, dataset) : corners_of_images(settings, dataset);
  if (!read) return read.error();
  std::vector<CornerView> views = std::move(*read);
  const HostStamp begin = views.front().stamp;
  std::erase_if(views, [&](const CornerView& view) {
    const double t = (view.stamp - begin).seconds();
    return t < settings.start_s || t > settings.start_s + settings.duration_s;
  });
  return views;
}

/// Images tell their size themselves.
Status read_size(const AslDataset& dataset, CalibrateSettings& settings) {
  if (dataset.images.empty()) return Done{};
  GreyImage image;
  if (const Status s = dataset.image_source->read(0, image); !s) return s;
  settings.width = image.width;
  settings.height = image.height;
  return Done{};
}

Result<LensFit> find_lens(const CalibrateSettings& settings, const std::vector<CornerView>& views,
                          const std::optional<CameraCalibration>& guess) {
  const int width = settings.width > 0 ? settings.width : guess ? guess->parameters.width : 0;
  const int height = settings.height > 0 ? settings.height : guess ? guess->parameters.height : 0;
  if (width <= 0 || height <= 0) {
    return Error{ErrorKind::kUsage, "", 0, "the size of the images is not known",
                 "--resolution WIDTHxHEIGHT, as these are corners without images and there is no guess"};
  }
  if (settings.hold_lens) {
    if (!guess)
      return Error{ErrorKind::kUsage, "", 0, "there is no lens to hold", "--guess FILE with a calibrated lens"};
    return fit_board(views, guess->parameters);
  }
  const std::optional<CameraParameters> from = guess ? std::optional(guess->parameters) : std::nullopt;
  if (settings.model) return fit_lens(views, *settings.model, width, height, from);
  if (guess) return fit_lens(views, guess->parameters.model, width, height, from);
  return choose_lens(views, width, height);
}

}  // namespace

std::vector<CameraOrientation> turns_of(const std::vector<CornerView>& views, const LensFit& lens) {
  std::vector<CameraOrientation> turns;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (lens.poses[i]) turns.push_back({views[i].stamp, lens.poses[i]->R_CT.transpose()});
  return turns;
}

bool Calibration::good() const {
  return std::all_of(verdicts.begin(), verdicts.end(), [](const Verdict& v) { return v.good; });
}

Result<Calibration> calibrate(const CalibrateSettings& settings) {
  auto dataset = open_uncalibrated_asl_dataset(settings.dataset, settings.camera, settings.imu_file);
  if (!dataset) return dataset.error();
  const auto guess = read_guess(settings, *dataset);
  if (!guess) return guess.error();
  CalibrateSettings known = settings;
  if (const Status s = read_size(*dataset, known); !s) return s.error();
  const auto views = read_views(settings, *dataset);
  if (!views) return views.error();
  const auto named = [&](Error error) {
    if (error.file.empty()) error.file = dataset->image_list.string();
    return error;
  };
  const auto lens = find_lens(known, *views, *guess);
  if (!lens) return named(lens.error());
  const auto turns = align_turns(turns_of(*views, *lens), dataset->imu_samples);
  if (!turns) return named(turns.error());
  auto fit = fit_rig(*views, *lens, *turns, dataset->imu_samples,
                     {.noise = dataset->imu.noise, .hold_lens = settings.hold_lens});
  if (!fit) return named(fit.error());

  Calibration c;
  const RigConstants& found = fit->state.constants;
  c.camera = {found.lens, found.R_BC, found.p_BC, found.time_offset_s};
  c.imu = dataset->imu;
  c.imu.noise.gyroscope_density = fit->noise.gyroscope_density;
  c.imu.noise.accelerometer_density = fit->noise.accelerometer_density;
  c.image_rate_hz = 1 / median_period(*views);
  c.imu_rate_hz = 1 / median_period(dataset->imu_samples);
  c.guess = *guess;
  c.fit = std::move(*fit);
  judge(c);
  return c;
}

}  // namespace epiline
