#pragma once
// The folder of a recording: `mav0/{cam0,imu0}` in the ASL layout, with cam1 to cam3 if there are several cameras. It
// is a valid recording at any time, even if the program is killed: an image is listed once its file is complete, and
// lists consist of whole lines.
#include <array>
#include <cstddef>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "drivers/program/record/disk.h"
#include "pipeline/config/calibration.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

/// The known properties of the sensors, for their `sensor.yaml`.
struct RecordedSensors {
  std::array<std::optional<CameraCalibration>, kMostOthers + 1> cameras;
  std::optional<ImuCalibration> imu;
  int width = 0, height = 0;
  double image_rate_hz = 0, reading_rate_hz = 0;
};

/// One thread uses it; another one may destroy it.
class RecordingFiles {
 public:
  /// Creates the folders and empty lists, for one camera or two. Fails if and only if `folder` holds a recording or
  /// cannot be written.
  static Result<std::unique_ptr<RecordingFiles>> create(const std::filesystem::path& folder, Disk& disk,
                                                        std::size_t cameras = 1);
  /// Removes the recording if it is empty.
  ~RecordingFiles();
  RecordingFiles(const RecordingFiles&) = delete;
  RecordingFiles& operator=(const RecordingFiles&) = delete;

  /// Writes an image of that camera; `png` as from png_of(). It is listed within a second, once it is on the disk, so
  /// that a list never names an image that a cut of the power took. Fails if and only if the image or a line cannot be
  /// written.
  Status add_image(std::size_t camera, HostStamp stamp, const std::string& png);
  Status add_readings(std::span<const ImuSample> readings);
  /// Replaces the files `sensor.yaml`. Readers ignore a file without a calibration (holds_no_calibration()).
  Status describe(const RecordedSensors& sensors) const;
  std::uint64_t bytes() const;
  /// Waits until the lists are on the disk.
  Status close();

 private:
  struct Images {
    std::filesystem::path folder;
    LineFile list;
    std::string unlisted;  ///< lines of images that may not be on the disk yet
    Images(Disk& disk, std::filesystem::path of_camera)
        : folder(std::move(of_camera)), list(disk, folder / "data.csv") {}
  };

  RecordingFiles(std::filesystem::path root, Disk& disk, std::size_t cameras);
  /// Syncs the disk and lists what is there, if that was a second ago.
  Status settle(HostStamp now);
  Status settle();
  /// Why a list cannot be written, if one cannot.
  Status fault() const;

  std::filesystem::path root_;
  Disk& disk_;
  std::deque<Images> images_;  ///< of each camera
  LineFile readings_;
  std::uint64_t image_bytes_ = 0;
  bool is_empty_ = true;
  HostStamp settled_;
  std::string lines_;  ///< buffer for lines that are being formatted
};

}  // namespace epiline
