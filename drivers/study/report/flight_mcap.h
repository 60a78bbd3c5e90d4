#pragma once
// A flight as an MCAP file of ROS 2: what went in, what came out, and the truth (docs/replay.md).
#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "drivers/flights/recordings/mcap_output.h"
#include "estimator/config.h"
#include "pipeline/realtime/flight_observer.h"
#include "pipeline/text/trajectory.h"

namespace epiline {

class CdrWriter;

/// Observes a flight in one thread; packing images and writing them takes memory and time.
class FlightMcap final : public FlightObserver {
 public:
  explicit FlightMcap(const std::filesystem::path& path);

  void imu(const ImuSample& sample) noexcept override;
  void image(const Frame& frame, const OtherFrames& others) noexcept override;
  void take(const FrameOutcome& outcome) noexcept override;
  void tracks(const LoggedTracks& tracks) noexcept override;
  bool wants_images() const noexcept override { return true; }

  Status status() const { return file_.status(); }
  /// After the flight. `flown`: what was estimated when a record of the flight recorder was made. Fails if and only if
  /// the file could not be written whole.
  Status finish(const std::optional<Trajectory>& truth, const std::optional<Trajectory>& flown = {});

 private:
  /// A topic, made when its first message comes.
  struct Topic {
    std::string name, type;
    std::uint16_t channel = 0;
  };
  void write(Topic& topic, HostStamp stamp, const CdrWriter& message);
  void write_image(std::size_t camera, const Frame& frame);
  void write_points(std::size_t camera, HostStamp stamp, std::span<const LoggedPoint> points);
  void write_path(Topic& topic, const char* frame, const std::optional<Trajectory>& path);

  McapOutput file_;
  Topic imu_{"/imu0", "sensor_msgs/Imu"}, odometry_{"/epiline/odometry", "nav_msgs/Odometry"},
      pose_{"/epiline/pose", "geometry_msgs/PoseStamped"}, tf_{"/tf", "tf2_msgs/TFMessage"},
      diagnostics_{"/diagnostics", "diagnostic_msgs/DiagnosticArray"},
      truth_{"/ground_truth/pose", "geometry_msgs/PoseStamped"},
      flown_{"/epiline/flown/pose", "geometry_msgs/PoseStamped"};
  std::array<Topic, 1 + kMostOthers> images_, tracks_;
};

}  // namespace epiline
