#pragma once
// The folder of a recording: `mav0/{cam0,imu0}` in the layout of ASL. Whenever the program is ended, what lies there is
// a recording up to then: an image is listed once its file is whole, and lists end with whole lines.
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "drivers/program/record/disk.h"
#include "pipeline/config/calibration.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

/// What is known of the sensors, for their `sensor.yaml`.
struct RecordedSensors {
  std::optional<CameraCalibration> camera;
  std::optional<ImuCalibration> imu;
  int width = 0, height = 0;
  double image_rate_hz = 0, reading_rate_hz = 0;
  std::string comment;
};

/// One thread, but for the destructor.
class RecordingFiles {
 public:
  /// Makes the folders and the empty lists. Fails if and only if there is a recording already, or one cannot be made.
  static Result<std::unique_ptr<RecordingFiles>> create(const std::filesystem::path& folder, Disk& disk);
  /// Removes a recording in which nothing lies.
  ~RecordingFiles();
  RecordingFiles(const RecordingFiles&) = delete;
  RecordingFiles& operator=(const RecordingFiles&) = delete;

  /// A PNG as png_of() makes it. Fails if and only if it could not be written, or not be listed.
  Status add_image(HostStamp stamp, const std::string& png);
  Status add_readings(std::span<const ImuSample> readings);
  /// Replaces both `sensor.yaml`. A file without a calibration counts as none (holds_no_calibration()).
  Status describe(const RecordedSensors& sensors) const;
  std::uint64_t bytes() const { return image_bytes_ + images_.bytes() + readings_.bytes(); }
  /// Waits until the lists are on the disk.
  Status close();

 private:
  RecordingFiles(std::filesystem::path root, Disk& disk);

  std::filesystem::path root_;
  Disk& disk_;
  LineFile images_, readings_;
  std::uint64_t image_bytes_ = 0;
  bool is_empty_ = true;
  std::string lines_;  ///< in the making
};

}  // namespace epiline
