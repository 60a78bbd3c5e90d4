#pragma once
// A recorded flight through the pipeline: in one thread as fast as it goes, or in threads in real time.
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "drivers/flights/recordings/bag_dataset.h"
#include "drivers/flights/recordings/fault_injection.h"
#include "drivers/flights/recordings/flight_plan.h"
#include "drivers/study/replay/flight_view.h"
#include "drivers/study/report/flight_record.h"
#include "platform/error/result.h"

namespace epiline {

struct ReplayOptions : FlightPart {
  std::filesystem::path dataset;
  std::string camera = "cam0";
  BagTopics topics;
  std::filesystem::path config_file;          ///< empty: defaults
  std::vector<std::string> set;               ///< settings as ConfigFile::set() takes them; they win over the file
  std::optional<VisualFactor> visual_factor;  ///< wins over the file
  std::optional<double> deadline_ms;          ///< wins over the file
  std::optional<double> loop_s;               ///< the flight again and again until it has lasted so long
  std::optional<double> realtime_speed;    ///< in threads, seconds of the recording in one second; none: in one thread
  bool imu_rate = false;                   ///< in threads: keep the odometry of every IMU reading
  std::vector<Fault> faults;               ///< what goes wrong with the sensors on the way
  std::function<void(AslDataset&)> alter;  ///< changes readings, stamps or calibration before the flight; may be empty
  /// A change that does not matter, for the spread of errors that chance makes: so many images are left out at the
  /// beginning, and the accelerometer measures so many times 1e-7 more, gravity's seventh digit.
  int perturb = 0;
  OdometrySink* odometry = nullptr;     ///< gets what is published; in one thread the estimate of each image
  FlightView* view = nullptr;           ///< shows a flight in threads while it goes on; open, not started
  std::filesystem::path record_folder;  ///< of the flight recorder, in threads only; wins over the file; empty: none
  bool record_images = false;
};

struct ReplayResult {
  FlightRecord record;
  std::vector<std::string> notes;  ///< for the user, a line each
};

/// Replays the flight. `progress` is called with images done and images in all. Fails if and only if configuration,
/// data set or an image is wrong (ErrorKind::kUsage); a flight without a single pose is a result.
Result<ReplayResult> replay(const ReplayOptions& options,
                            const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace epiline
