#pragma once
// The data that stages pass to each other, and the rings that carry them.
#include <atomic>
#include <cstdint>

#include "pipeline/stages/frame_outcome.h"
#include "pipeline/stages/knowledge.h"
#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/newest_ring.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/memory/fixed_vector.h"
#include "platform/samples/samples.h"

namespace epiline {

inline constexpr std::size_t kImuRing = 4096;  ///< 20 s at 200 Hz, 4 s at 1 kHz
using ImuRing = SpscRing<ImuSample, kImuRing>;
/// Ring of a sensor for which images do not wait.
template <class Sample>
using SideRing = SpscRing<Sample, 256>;
using WheelRing = SideRing<WheelSample>;
using HeightRing = SideRing<HeightSample>;
using KnowledgeRing = SpscRing<Knowledge, 4>;
using FrameRing = NewestRing<4>;  ///< numbers of buffers: LentImages

/// An image on its way from the tracker to the estimator.
struct Tracked {
  TrackedFrame frame;
  StageTime track;  ///< 0 with recorded tracks
};
using TrackedRing = SpscRing<Tracked, 4>;

/// The newest estimate, for the publisher.
struct Estimate {
  std::uint64_t serial = 0;  ///< from 1; 0: none yet
  bool has_pose = false;
  Odometry odometry;
  // Corrects the prediction, once for each `solved_serial`. Later estimates repeat it, so that it is not lost with an
  // estimate that was superseded.
  std::uint64_t solved_serial = 0;  ///< 0: none yet
  Odometry solved;
};

/// When a sensor last delivered something, for the publisher. The numbers are independent: no order is needed.
class Heard {
 public:
  void tell(HostStamp last, Span period) noexcept {
    last_ns_.store(last.ns, std::memory_order_relaxed);
    period_ns_.store(period.ns, std::memory_order_relaxed);
  }
  HostStamp last() const noexcept { return HostStamp{last_ns_.load(std::memory_order_relaxed)}; }
  Span period() const noexcept { return Span{period_ns_.load(std::memory_order_relaxed)}; }

 private:
  std::atomic<std::int64_t> last_ns_{0}, period_ns_{0};
};

/// Published odometry, for the log.
struct Publication {
  std::uint64_t serial = 0;     ///< of the FrameOutcome
  std::int64_t latency_ns = 0;  ///< since the instant of the image's stamp
};

/// The part of a TrackedFeature that is logged.
struct LoggedPoint {
  std::uint32_t id = 0, age = 0;  ///< age: images since the track began
  float u = 0, v = 0;             ///< raw pixels
};

/// The part of a TrackedFrame that is logged.
struct LoggedTracks {
  std::uint64_t serial = 0;    ///< of the FrameOutcome
  std::uint64_t sequence = 0;  ///< of the camera's images
  HostStamp stamp;
  FixedVector<LoggedPoint, kMaxFeatures> points;
  /// What cameras 1 to 3 see: pixels of their images.
  std::array<FixedVector<LoggedPoint, kMaxFeatures>, kMostOthers> others;
};

// The rings to the log. A full one refuses and counts: no stage waits for the log.
using ImuLogRing = SpscRing<ImuSample, 4096>;  ///< 4 s at 1 kHz; a log thread that is delayed longer loses samples
template <class Sample>
using SideLogRing = SpscRing<Sample, 512>;  ///< as long at 100 Hz
using WheelLogRing = SideLogRing<WheelSample>;
using HeightLogRing = SideLogRing<HeightSample>;
using OutcomeRing = SpscRing<FrameOutcome, 256>;
using TracksLogRing = SpscRing<LoggedTracks, 64>;
using PublicationRing = SpscRing<Publication, 256>;

}  // namespace epiline
