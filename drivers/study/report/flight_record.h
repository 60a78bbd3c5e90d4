#pragma once
// Everything a run leaves behind: what stats.json and report.html are made of.
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "drivers/flights/recordings/image_source.h"
#include "drivers/study/evaluate/errors.h"
#include "estimator/estimator.h"
#include "pipeline/realtime/realtime_pipeline.h"
#include "pipeline/recorder/flight_recorder.h"
#include "pipeline/stages/frame_outcome.h"
#include "pipeline/text/trajectory.h"
#include "pipeline/vision/second_tracker.h"
#include "pipeline/vision/tracker.h"
#include "pipeline/watch/image_gate.h"
#include "pipeline/watch/imu_gate.h"
#include "platform/time/clock_state.h"

namespace epiline {

/// The time that the stages took for one image.
struct StageMilliseconds {
  double track = 0, solve = 0, marginalise = 0, estimate = 0;
  double frame() const { return track + estimate; }
};

/// One image that went through the pipeline.
struct ImageRecord {
  HostStamp stamp;
  bool has_pose = false, solved = false, keyframe = false;
  TimedPose pose;  ///< this and the following five only with a pose
  Vec3 v_WB_m_s = Vec3::Zero(), b_a_m_s2 = Vec3::Zero(), b_g_rad_s = Vec3::Zero();
  Vec3 sigma_v_m_s = Vec3::Zero(), sigma_b_a_m_s2 = Vec3::Zero(), sigma_b_g_rad_s = Vec3::Zero();
  PoseUncertainty uncertainty;
  double time_offset_s = 0;
  Health health;
  int tracks = 0, new_tracks = 0;
  StageMilliseconds wall_ms, cpu_ms;
  std::optional<double> latency_ms;  ///< from the stamp to the odometry handed out; only of a real-time run's poses
};

/// The odometry handed out at the IMU's rate.
struct PredictedPath {
  Trajectory trajectory;
  double largest_jump_m = 0;  ///< between two readings, beyond what the two velocities explain; resets left out
  double largest_jump_rad = 0, largest_jump_m_s = 0;  ///< beyond the angular rates; of velocity from reading to reading
};

/// What one receiver of the odometry got: a flight controller, a bus.
struct OutputRecord {
  std::string name;  ///< of the port, for people
  std::uint64_t sent = 0, not_sent = 0, reopened = 0;
  LatencyBins latency;  ///< from an image's stamp to the last byte of the first message that knew of it
};

/// One of the figures that a device's driver counts.
struct DeviceCount {
  std::string name;
  std::uint64_t value = 0;
  bool is_fault = false;  ///< should be 0
};

/// A setting of the device itself that does not suit, and what to do.
struct DeviceAdvice {
  bool is_error = false;  ///< false: a warning
  std::string text, remedy;
};

/// What a device's driver counted.
struct DeviceRecord {
  std::string name;  ///< camera, imu, ...
  std::vector<DeviceCount> counts;
  std::optional<ClockState> clock;        ///< of a device with a clock of its own
  std::string refusal = {}, remedy = {};  ///< what keeps the device from serving as it should, and what to do
  std::vector<DeviceAdvice> advice = {};
  std::string note = {};  ///< what is known of the device, for people; may be empty
};

/// How the threads of a real-time run fared.
struct RealtimeRecord {
  double speed = 1;                     ///< of the recording's clock
  std::vector<std::string> shortfalls;  ///< privileges asked for and not given, a line each
  RealtimeReport report;
  std::optional<RecorderReport> recorder;  ///< none without a recorder
  std::optional<PredictedPath> predicted;  ///< if it was asked for
  std::vector<OutputRecord> outputs;       ///< of a live run, as the following
  std::vector<DeviceRecord> devices;
};

ImageRecord image_record(const FrameOutcome& outcome);

struct FlightRecord {
  // input
  std::string dataset_path;
  double dataset_duration_s = 0;
  std::size_t dataset_images = 0, dataset_imu_samples = 0;
  std::optional<Trajectory> truth;
  // settings
  std::string visual_factor;
  int keyframes = 0, threads = 1;
  std::optional<int> max_features;  ///< none with recorded tracks
  std::optional<double> deadline_ms;
  // run
  std::size_t images_read = 0;  ///< taken from the recording, skipped ones included
  std::map<std::string, std::uint64_t> skipped;
  UnreadableImages unreadable;  ///< left out, of all cameras
  std::size_t imu_read = 0;
  std::vector<ImageRecord> images;  ///< those that went through the pipeline, in time order
  std::vector<Event> events;        ///< in no particular order
  std::uint64_t events_lost = 0;    ///< for which there was no room
  EstimatorStats estimator;
  ImuGateStats imu_watch;
  ImageGateStats image_watch;
  LoadGovernor::Counts load;
  std::optional<TrackerStats> tracker;                         ///< none with recorded tracks
  std::array<std::optional<SecondStats>, kMostOthers> others;  ///< of cameras 1 to 3, those that are there
  double peak_rss_mib = 0;
  std::optional<std::uint64_t> heap_calls;  ///< inside the stages; none where they cannot be counted
  std::optional<std::uint64_t> lock_calls;  ///< of a real-time run's threads; none where they cannot be counted
  std::uint64_t page_faults = 0;            ///< inside the stages
  std::optional<RealtimeRecord> realtime;   ///< none of a run in one thread
  std::optional<Error> unwritten;           ///< of a file that grows during the flight
};

/// Readings of the IMU that were left out, by the watch or by the estimator.
struct ImuLeftOut {
  std::uint64_t out_of_order = 0, duplicate = 0, not_finite = 0, impossible = 0;
};
ImuLeftOut imu_left_out(const FlightRecord& record);

/// The estimated poses, and what the estimator says of their errors.
Trajectory trajectory_of(const FlightRecord& record);
Claims claims_of(const FlightRecord& record);

/// The events a line each, in the order of time; those of one instant in the order they came.
std::string events_text(const FlightRecord& record);

/// Errors against the recording's ground truth, if it has one.
std::optional<TrajectoryErrors> errors_of(const FlightRecord& record);

}  // namespace epiline
