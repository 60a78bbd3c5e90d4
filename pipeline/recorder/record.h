#pragma once
// The records on the recorder's tapes, and the folder that is written from them.
#include <filesystem>
#include <string>

#include "pipeline/recorder/flight_recorder.h"
#include "pipeline/recorder/tape.h"

namespace epiline {

enum class RecordKind : std::uint32_t { kImu, kState, kTracks, kImage, kEvent, kWheel, kHeight };

/// The estimate of one image.
struct RecordedState {
  HostStamp stamp;
  std::uint64_t serial = 0;
  std::array<double, 3> p_WB_m{};
  std::array<double, 4> q_WB{};
  std::array<double, 3> v_WB_m_s{}, gyroscope_bias_rad_s{}, accelerometer_bias_m_s2{};
  std::array<double, 3> sigma_p_m{}, sigma_theta_rad{}, sigma_v_m_s{};
  double time_offset_s = 0;
  std::uint32_t reset_counter = 0, reasons = 0;
  std::int32_t quality = 0, tracks = 0;
  std::uint8_t state = 0;
  bool has_pose = false, solved = false, keyframe = false;
};
RecordedState recorded_state(const FrameOutcome& outcome) noexcept;

/// Followed by `count` points.
struct RecordedTracksHeader {
  HostStamp stamp;
  std::uint64_t count = 0;
};
struct RecordedPoint {
  std::uint32_t id = 0;
  float u = 0, v = 0;
};

/// Followed by the rows of pixels.
struct RecordedImageHeader {
  HostStamp stamp;
  std::int32_t width = 0, height = 0;
  std::int32_t camera = 0;  ///< its number
};

/// A record of a loss is written twice: at once, for what made the estimate wrong may break the vehicle, and again when
/// the seconds after it have passed. The second one takes the first one's place.
enum class RecordPart : std::uint8_t { kWhole, kFirst, kSecond };

/// A record to write: time span and lent segments.
struct RecordOrder {
  std::uint64_t number = 0;
  RecordReason reason = RecordReason::kRequested;
  RecordPart part = RecordPart::kWhole;
  HostStamp from, now;
  Tape::Range samples, images;
};

/// Writes the folder `name`, whole or not at all. Returns each segment to its tape as soon as it has been read, and all
/// of them on failure. Fails if and only if a file cannot be written; `failure` is then errno, 0 if unknown.
Status write_record(const RecordOrder& order, const RecordedRun& run, Tape& samples, Tape* images,
                    const std::filesystem::path& name, int& failure);

}  // namespace epiline
