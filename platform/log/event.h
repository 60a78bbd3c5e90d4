#pragma once
// What happens on the hot path is logged as fixed binary events through a ring; another thread turns them into text.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/concurrency/spsc_ring.h"
#include "platform/time/clock.h"

namespace epiline {

/// Kinds of events; the comment lists the arguments. event.cc defines their names and format: a new kind goes before
/// kCount and needs a line there. docs/fly.md explains each to users.
enum class EventId : std::uint16_t {
  kImageDropped,    ///< first sequence number, ImageLoss, how many
  kImuLate,         ///< ms that an image waited for the IMU sample of this time, without success
  kImuGap,          ///< ns
  kImuRefused,      ///< 1 begins, 0 ends; readings; ImuRefusal
  kImuSaturated,    ///< 1 begins, 0 ends; readings
  kDeadlineMissed,  ///< sequence number, ns
  kStarted,         ///< StartKind
  kHealthChanged,   ///< HealthState before and now, HealthReason bits
  kReset,           ///< number of resets so far
  kSourceLost,      ///< EventSource
  kSourceFound,     ///< EventSource
  kClockJump,       ///< EventSource, correction of its timestamps from now on, ns
  kImagesFrozen,    ///< 1 begins, 0 ends; images
  kLensCovered,     ///< 1 begins, 0 ends; images
  kImagesRepeated,  ///< 1 begins, 0 ends; images
  kImuInBursts,     ///< readings of a burst
  kLoadLevel,       ///< LoadLevel before and now
  kRingOverflow,    ///< RingName, elements lost
  kRecordWritten,   ///< number of the record, RecordReason
  kRecordFailed,    ///< number of the record, RecordReason, errno if known
  kNumberWrong,     ///< Suspect, Severity, figure (pipeline/text/suspicion_text.h)
  kOtherBlind,      ///< 1 begins, 0 ends; images frozen or without a picture; of which camera, 1 to 3
  kCount
};

enum class EventSource : std::uint8_t { kCamera, kImu, kWheel, kHeight, kOdometry };
enum class ImageLoss : std::uint8_t { kOvertaken, kMissed, kRefused };
enum class ImuRefusal : std::uint8_t { kOutOfOrder, kDuplicate, kNotFinite, kOtherTime, kImpossible };
enum class RecordReason : std::uint8_t { kRequested, kLost, kEnd };
inline constexpr const char* kRecordReasonNames[] = {"requested", "lost", "end"};
/// In the order of LoadLevel.
inline constexpr const char* kLoadLevelNames[] = {"full", "fewer_features", "fewer_iterations", "prediction_only"};
/// The rings between the threads of a real-time run.
enum class RingName : std::uint8_t {
  kFrames,
  kImuToTrack,
  kImuToEstimate,
  kImuToPublish,
  kTracked,
  kKnowledge,
  kOutcomes,
  kPublications,
  kTracksToLog,
  kImuToLog,
  kImagesToLog,
  kEvents,
  kWheelToEstimate,
  kWheelToLog,
  kHeightToEstimate,
  kHeightToLog,
  kCount
};
const char* to_string(RingName) noexcept;

struct Event {
  HostStamp stamp;
  EventId id = EventId::kCount;
  std::array<std::int64_t, 3> args{};
};

/// With numbers or values of enumerations as arguments.
template <class... Arguments>
constexpr Event make_event(HostStamp stamp, EventId id, Arguments... arguments) noexcept {
  return {stamp, id, {static_cast<std::int64_t>(arguments)...}};
}

/// One per thread that logs events.
using EventRing = SpscRing<Event, 1024>;

/// The name alone; "unknown" for an invalid value.
const char* to_string(EventId) noexcept;

/// Writes `SECONDS name argument=value ...` with a final zero into `text`, cut to its size. Returns the characters
/// written, the zero not counted. No heap.
std::size_t format_event(const Event& event, std::span<char> text) noexcept;

}  // namespace epiline
