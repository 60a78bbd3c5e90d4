#pragma once
// A flight with a fault in it: what was reported, and was anything called good that was wrong?
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/study/replay/replay.h"
#include "pipeline/text/trajectory.h"

namespace epiline::test {

/// Keeps everything that is published, in threads at the IMU's rate as well. Asks for its memory at the beginning.
class PublishedOdometry final : public OdometrySink {
 public:
  explicit PublishedOdometry(std::size_t most) { all_.reserve(most); }
  Status open() override { return Done{}; }
  void close() noexcept override {}
  bool publish(const Odometry& odometry) noexcept override { return publish_image(odometry); }
  bool publish_image(const Odometry& odometry) noexcept override {
    if (all_.size() < all_.capacity()) all_.push_back(odometry);
    return true;
  }
  const std::vector<Odometry>& all() const { return all_; }

 private:
  std::vector<Odometry> all_;
};

struct FaultVerdict {
  bool ran = false;
  std::uint32_t reasons = 0;                                  ///< said of the fault
  std::uint32_t reasons_before = 0;                           ///< said in the second before the fault
  bool degraded = false, lost = false, initialising = false;  ///< in the same time
  double recovered_s = -1;    ///< from the end of the fault until tracking lasts 1 s; negative: never
  double not_tracking_s = 0;  ///< between the beginning of the fault and the end of the flight
  double final_error_m =
      0;                   ///< position, aligned before the fault (without poses then, and after a reset: at the first)
  double worst_ratio = 0;  ///< error over sigma where the health was tracking: position, velocity, tilt
  double worst_at_s = 0;   ///< after the first image
  char worst_what = ' ';   ///< p, v or t
  std::size_t wrong = 0, published = 0;  ///< odometry called tracking beyond 3.5 sigma; all since the fault
  std::uint32_t resets = 0;
};

/// Seconds after the first image: beginning and end of the fault, and how long what is said counts as said of it.
struct FaultTimes {
  double from_s = 0, to_s = 0, said_until_s = 0;
};

/// Replays `options`, of a data set with truth, with the faults and compares what is published with the truth.
FaultVerdict fly_with(ReplayOptions options, const std::vector<Fault>& faults, const FaultTimes& times);

/// What was published of a flight, compared with the truth. `zero`: the instant that `times` count from. Place and
/// heading are compared in the frame of the last quiet seconds before `from_s`, or of the `origins` to which
/// covariances refer.
FaultVerdict judge(const std::vector<Odometry>& published, const Trajectory& truth, HostStamp zero,
                   const FaultTimes& times, std::span<const WorldOrigin> origins = {});

/// Where an odometry is.
TimedPose pose_of(const Odometry& odometry);

/// Names of the reasons, with commas; "nothing" if there are none.
std::string reason_names(std::uint32_t reasons);

}  // namespace epiline::test
