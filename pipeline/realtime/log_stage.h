#pragma once
// Passes the contents of the log rings to the observers of the flight.
#include <array>
#include <utility>

#include "pipeline/realtime/flight_log.h"
#include "pipeline/stages/lent_images.h"
#include "pipeline/stages/stage.h"
#include "pipeline/stages/stage_clocks.h"

namespace epiline {

/// Each step passes on all elements present. Ends when the last stage that writes to the log has ended.
class LogStage final : public Stage {
 public:
  struct Inputs {
    FlightLog& log;
    LentImages& images;
    std::array<const EndMark*, 3> writers_ended{};
    /// Rings between other stages. An event reports each of their losses.
    std::array<std::pair<RingName, const ImuRing*>, 3> imu;
    const WheelRing& speeds;
    const HeightRing& heights;
  };

  LogStage(const FlightClock& clock, const Inputs& in) : clock_(clock), in_(in) {}

  Step step() noexcept override;
  bool ready() noexcept override { return !in_.log.empty() || over(); }

 private:
  bool over() const noexcept;

  FlightClock clock_;
  Inputs in_;
};

}  // namespace epiline
