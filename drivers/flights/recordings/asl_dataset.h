#pragma once
// A recorded flight in the layout of ASL (EuRoC): `mav0/{cam0,imu0,state_groundtruth_estimate0}`. TUM-VI's differs a
// little: `mav0/{cam0,imu0,mocap0}` with the calibration in `dso/{camchain,imu_config}.yaml` beside.
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/config/calibration.h"
#include "pipeline/stages/recorded_tracks.h"
#include "pipeline/text/trajectory.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

class ImageSource;

/// An image that has not been read yet: a file, or a message of a bag.
struct ImageFile {
  HostStamp stamp;
  std::filesystem::path path;
  int line = 0;  ///< line in the list that names it; 0: none
};

/// The points of one instant: points[first, first + count).
struct TrackInstant {
  HostStamp stamp;
  std::size_t first = 0, count = 0;
};

/// IMU samples, wheel speeds, heights and ground truth of a flight.
struct AslMotion {
  std::filesystem::path root;  ///< the folder that contains cam0 and imu0
  ImuCalibration imu;
  std::vector<std::string> notes;    ///< remarks for the user, one line each
  std::filesystem::path imu_file;    ///< data.csv[.gz]
  std::filesystem::path truth_file;  ///< empty if there is none
  /// In the file's order, as they came: imu.correction is to be applied. The estimator counts bad samples.
  std::vector<ImuSample> imu_samples;
  std::vector<WheelSample> wheel_samples;    ///< of wheel0/data.csv: time, forward speed in m/s; empty if there is none
  std::vector<HeightSample> height_samples;  ///< of baro0/data.csv and range0/data.csv: time, m; in the order of time
  std::optional<Trajectory> ground_truth;
};

struct AslDataset : AslMotion {
  std::filesystem::path image_list;  ///< data.csv or tracks.csv[.gz] of the camera
  CameraCalibration camera;
  std::vector<ImageFile> images;              ///< in the file's order; empty when there are tracks
  std::shared_ptr<ImageSource> image_source;  ///< of `images`
  std::vector<TrackInstant> instants;         ///< in the file's order; empty when there are images
  std::vector<TrackPoint> points;
  /// Images and lens of cameras 1, 2 and 3, as far as they were opened. The rest of each is empty.
  std::vector<std::shared_ptr<AslDataset>> others;
  std::size_t instants_count() const { return images.empty() ? instants.size() : images.size(); }
  HostStamp instant(std::size_t i) const { return images.empty() ? instants[i].stamp : images[i].stamp; }
  /// The earliest and the latest.
  std::pair<HostStamp, HostStamp> extent() const;
};

/// Reads IMU and ground truth of the folder (or its `mav0`), which may lack a camera. `imu_file`: a calibration that
/// replaces the data set's. Fails like open_asl_dataset().
Result<AslMotion> open_asl_motion(const std::filesystem::path& folder, const std::filesystem::path& imu_file = {});

/// The readings as a right IMU gives them.
std::vector<ImuSample> corrected_samples(const AslMotion& motion);

/// Opens the folder (or its `mav0`) and reads everything but the images. `camera`: cam0, cam1. Calibration comes from
/// the files named in `camera_file` and `imu_file` instead of the data set's if they are not empty. Fails if and only
/// if a file is missing that a replay needs (calibration, image list, IMU), one does not parse, images or IMU are
/// empty, they have no time in common, or rates and accelerations are exchanged. A missing `imu0/sensor.yaml` or ground
/// truth is not an error.
Result<AslDataset> open_asl_dataset(const std::filesystem::path& folder, const std::string& camera,
                                    const std::filesystem::path& camera_file = {},
                                    const std::filesystem::path& imu_file = {});

/// Adds the images of the next camera, cam1 for instance: at most kMostOthers. Its calibration is the data set's, or
/// that of `camera_file` if this is a chain (Kalibr) with that camera. Fails if and only if one of both cameras has no
/// images, or a file is missing or does not parse.
Status open_other_camera(AslDataset& dataset, const std::string& camera, const std::filesystem::path& camera_file = {});

/// How many cameras the folder (or its `mav0`) has: cam0, cam1 and so on without a gap, up to kMostOthers beside cam0.
std::size_t count_cameras(const std::filesystem::path& folder);

/// The same without the camera's calibration, which is still to be found, and without ground truth.
Result<AslDataset> open_uncalibrated_asl_dataset(const std::filesystem::path& folder, const std::string& camera,
                                                 const std::filesystem::path& imu_file = {});

}  // namespace epiline
