#pragma once
// Writes a simulated flight as an ASL folder, which a replay reads.
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "drivers/laboratory/simulate/track_simulator.h"
#include "pipeline/config/calibration.h"
#include "pipeline/text/output_files.h"
#include "platform/error/result.h"

namespace epiline {

/// Creates `folder`/mav0 under a temporary name, with cam0/data, imu0 and state_groundtruth_estimate0, for other
/// cameras also cam1/data and so on. Fails if and only if a folder cannot be created.
Result<PartialFolder> make_asl_folder(const std::filesystem::path& folder, std::size_t other_cameras = 0);

/// Where the body was, and what its IMU added.
struct TruthRow {
  HostStamp stamp;
  BodyState state;
};

/// All of a flight but its images.
struct FlightTables {
  std::string comment;  ///< for the camera's sensor.yaml: where the flight comes from
  CameraCalibration camera;
  std::vector<CameraCalibration> other_cameras;  ///< beside the first one, at most kMostOthers
  double image_rate_hz = 20;
  ImuCalibration imu;
  std::vector<ImuSample> imu_samples;
  std::vector<WheelSample> wheel_samples;    ///< none: no such file
  std::vector<HeightSample> height_samples;  ///< the same, for each kind
  std::vector<TruthRow> truth;
};

/// Writes sensor.yaml of the cameras, imu0/{sensor.yaml,data.csv}, {wheel0,baro0,range0}/data.csv and the truth. Fails
/// if and only if a file cannot be written whole.
Status write_tables(const FlightTables& tables, const std::filesystem::path& root);

/// One image's place in a camera's data.csv.
struct ImageRow {
  HostStamp stamp;
  std::string file;
};
/// `camera`: the folder of a camera, that of cam0 for instance.
Status write_image_list(const std::vector<ImageRow>& rows, const std::filesystem::path& camera);

/// Writes a flight with simulated tracks instead of images: `folder`/mav0, complete or not at all.
Status write_asl(const TrackSimulation& simulation, const SimulatedFlight& flight, const std::filesystem::path& folder,
                 const std::vector<WheelSample>& wheel_samples = {},
                 const std::vector<HeightSample>& height_samples = {});

}  // namespace epiline
