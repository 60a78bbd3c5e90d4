#pragma once
// Events from the findings of the input watch; used by replays in one thread and in real time.
#include <array>
#include <cstdint>

#include "pipeline/watch/image_gate.h"
#include "pipeline/watch/imu_gate.h"
#include "platform/log/event.h"
#include "platform/ports/ports.h"

namespace epiline {

/// Logs an event when a kind of bad samples begins, and one when there was none for half a second, so flickering is
/// reported once. Arguments of the event: 1 and samples so far, or 0 and samples in total; then `about`.
class Episode {
 public:
  explicit Episode(EventId id, std::int64_t about = 0) : id_(id), about_(about) {}
  explicit Episode(ImuRefusal why) : Episode(EventId::kImuRefused, static_cast<std::int64_t>(why)) {}
  /// `counter`: of all bad samples there were. `now`: in time order.
  void step(std::uint64_t counter, HostStamp now, EventRing& out) noexcept;

 private:
  EventId id_;
  std::int64_t about_;
  bool on_ = false;
  std::uint64_t known_ = 0, before_ = 0;  ///< bad samples; those before this episode
  HostStamp last_;
};

/// Belongs to the thread of the gate; no heap.
class ImuEvents {
 public:
  explicit ImuEvents(EventRing& out) : out_(out) {}
  /// After each ImuGate::step(reading), which returned `taken`.
  void after(bool taken, const ImuSample& reading, const ImuGate& gate) noexcept;

 private:
  EventRing& out_;
  HostStamp now_;  ///< of the last reading taken: a refused one's stamp may be anything
  Span correction_{};
  bool told_bursts_ = false;
  Episode saturated_{EventId::kImuSaturated};
  std::array<Episode, 5> refused_{Episode{ImuRefusal::kOutOfOrder}, Episode{ImuRefusal::kDuplicate},
                                  Episode{ImuRefusal::kNotFinite}, Episode{ImuRefusal::kOtherTime},
                                  Episode{ImuRefusal::kImpossible}};
};

/// The same for a camera's images.
class ImageEvents {
 public:
  explicit ImageEvents(EventRing& out) : out_(out) {}
  /// After each ImageGate::step(image), which returned `taken`.
  void after(bool taken, const Frame& image, const ImageGate& gate) noexcept;

 private:
  EventRing& out_;
  HostStamp now_;
  Span correction_{};
  std::uint64_t copies_ = 0;
  Episode frozen_{EventId::kImagesFrozen}, covered_{EventId::kLensCovered}, repeated_{EventId::kImagesRepeated};
};

/// Tells when a device is lost and when it is back. Belongs to the thread that reads the device; no heap.
class SourceEvents {
 public:
  SourceEvents(EventSource source, EventRing& out) : source_(source), out_(out) {}
  /// After each read() of the device. `now`: of the samples' clock.
  void after(ReadOutcome outcome, HostStamp now) noexcept;

 private:
  EventSource source_;
  EventRing& out_;
  bool lost_ = false;
};

}  // namespace epiline
