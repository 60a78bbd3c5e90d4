#pragma once
// A rig's calibration from a recording of a board, and how good each figure is, in words.
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "drivers/study/calibrate/rig_fit.h"
#include "pipeline/config/calibration.h"
#include "platform/error/result.h"

namespace epiline {

struct CalibrateSettings {
  std::filesystem::path dataset;
  std::string camera = "cam0";
  /// A calibration to start from; empty: the data set's own sensor.yaml if there is one; "none": nothing.
  std::filesystem::path guess;
  /// The board: target.csv, or a board's description. Empty: the data set's target.csv.
  std::filesystem::path board;
  std::optional<CameraModel> model;  ///< empty: the guess's, else the one that fits best
  int width = 0, height = 0;         ///< of the image; 0: the guess's, or the images' own
  bool hold_lens = false;            ///< the guess's lens is right: find the rest
  double start_s = 0, duration_s = std::numeric_limits<double>::infinity();  ///< of the images
  std::filesystem::path imu_file;  ///< the IMU's calibration; empty: the data set's
};

/// One figure or group of figures, as a person is told.
struct Verdict {
  bool good = false;
  std::string what, found,
      advice;  ///< "lens", "focal length 458.6 px +- 0.1", "wave more about ..."; advice may be empty
};

struct Calibration {
  CameraCalibration camera;
  ImuCalibration imu;
  double image_rate_hz = 0, imu_rate_hz = 0;
  std::optional<CameraCalibration> guess;
  RigFit fit;
  /// How far pixels are off for what is not known of the lens, rms over the image, the camera turned to fit best.
  double lens_px = 0;
  double covered = 0;  ///< share of the image's parts that saw corners
  std::vector<Verdict> verdicts;
  bool good() const;
};

/// The camera's turns before the board, of the views with a pose.
std::vector<CameraOrientation> turns_of(const std::vector<CornerView>& views, const LensFit& lens);

/// Fills in how good the figures are: lens_px, covered and verdicts.
void judge(Calibration& calibration);

/// Reads the recording and fits. Fails like the parts it is made of.
Result<Calibration> calibrate(const CalibrateSettings& settings);

}  // namespace epiline
