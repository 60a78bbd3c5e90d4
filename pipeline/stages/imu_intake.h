#pragma once
// Gives a stage the IMU samples before each image, and limits the time that it waits for them.
#include <cstdint>

#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/imu_feed.h"
#include "pipeline/stages/stage.h"
#include "pipeline/stages/stage_clocks.h"
#include "platform/log/event.h"

namespace epiline {

/// Begin an image, then call take() until it is true. Belongs to the thread of the stage; no heap.
class ImuIntake {
 public:
  /// `ended`: end mark of the stage that fills the ring. An image that has waited for `patience` continues without the
  /// sample, which is counted and reported. After the end no image waits.
  ImuIntake(ImuRing& ring, const EndMark& ended, Span patience, NowNs now, EventRing& events) noexcept
      : ring_(ring), ended_(ended), patience_(patience), now_(now), events_(events) {}

  /// The next image needs the readings up to and including the first that reaches this time.
  void begin(HostStamp needed) noexcept;
  bool begun() const noexcept { return begun_; }

  /// Calls `give(reading)` for the readings that are here and needed. True: the image has all it gets. False: wait
  /// until ready() or waits_until_ns().
  template <class Give>
  bool take(Give&& give) noexcept {
    while (feed_.wants_more(needed_)) {
      const bool over = ended_.is_set();  // before the look at the ring: what came before the end is found
      if (ring_.front() == nullptr) return done_if(gives_up(over));
      hand_on(give);
      waits_until_ns_ = kNotWaiting;
    }
    return done_if(true);
  }

  /// True if take() has something to do, whatever the time.
  bool ready() noexcept { return ended_.is_set() || ring_.front() != nullptr; }
  std::int64_t waits_until_ns() const noexcept { return waits_until_ns_; }

  /// While no image comes: hands on the oldest readings, which the stage would get anyway, before the ring is full.
  template <class Give>
  void relieve(Give&& give) noexcept {
    while (ring_.published() - ring_.popped() > kImuRing / 2 && ring_.front() != nullptr) hand_on(give);
  }

  std::uint64_t late() const noexcept { return late_.get(); }  ///< images that waited in vain

 private:
  static constexpr std::int64_t kNotWaiting = 0;

  template <class Give>
  void hand_on(Give& give) noexcept {
    feed_.took(*ring_.front());
    give(*ring_.front());
    ring_.pop();
  }
  bool gives_up(bool over) noexcept;
  bool done_if(bool done) noexcept {
    if (done) begun_ = false;
    return done;
  }

  ImuRing& ring_;
  const EndMark& ended_;
  Span patience_;
  NowNs now_;
  EventRing& events_;
  ImuFeed feed_;
  HostStamp needed_;
  Span patience_now_{};  ///< with this image
  bool begun_ = false;
  std::int64_t waits_until_ns_ = kNotWaiting;
  StageCount late_;
};

}  // namespace epiline
