#pragma once
// A made-up flight as a folder that a replay reads: ASL layout.
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/simulate/track_simulator.h"
#include "pipeline/config/calibration.h"
#include "platform/error/result.h"

namespace epiline {

/// A folder in the making: everything goes to `mav0.partial`, which finish() renames to `mav0`, replacing an older one.
/// Without finish() nothing is left behind.
class AslFolder {
 public:
  /// Makes `folder` and the parts inside. Fails if and only if a folder cannot be made.
  static Result<AslFolder> create(const std::filesystem::path& folder);
  ~AslFolder();
  AslFolder(AslFolder&& other) noexcept : folder_(std::move(other.folder_)) { other.folder_.clear(); }
  AslFolder& operator=(AslFolder&&) = delete;
  AslFolder(const AslFolder&) = delete;
  AslFolder& operator=(const AslFolder&) = delete;

  /// Holds cam0/data, imu0 and state_groundtruth_estimate0.
  std::filesystem::path root() const { return folder_ / "mav0.partial"; }
  /// Fails if and only if an older `mav0` cannot be replaced.
  Status finish();

 private:
  explicit AslFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}
  std::filesystem::path folder_;
};

/// Where the body was, and what its IMU added.
struct TruthRow {
  HostStamp stamp;
  BodyState state;
};

/// All of a flight but its images.
struct FlightTables {
  std::string comment;  ///< for the camera's sensor.yaml: where the flight comes from
  CameraCalibration camera;
  double image_rate_hz = 20;
  ImuCalibration imu;
  std::vector<ImuSample> imu_samples;
  std::vector<TruthRow> truth;
};

/// Writes cam0/sensor.yaml, imu0/{sensor.yaml,data.csv} and the truth. Fails if and only if a file cannot be written
/// whole.
Status write_tables(const FlightTables& tables, const std::filesystem::path& root);

/// One image's place in cam0/data.csv.
struct ImageRow {
  HostStamp stamp;
  std::string file;
};
Status write_image_list(const std::vector<ImageRow>& rows, const std::filesystem::path& root);

/// A flight of perfect tracks in place of images: `folder`/mav0, whole or not at all.
Status write_asl(const TrackSimulation& simulation, const SimulatedFlight& flight, const std::filesystem::path& folder);

}  // namespace epiline
