#pragma once
// Who shows a flight while it goes on, as a replay knows it.
#include <optional>
#include <string>

#include "estimator/geometry/types.h"
#include "pipeline/realtime/flight_observer.h"

namespace epiline {

/// What holds for the whole run.
struct ViewSubject {
  std::string title;         ///< of the page, for instance the recording's name
  std::string program;       ///< name and version
  std::optional<Mat3> R_BC;  ///< the camera's mounting; without it attitude is the body's
  bool images = true;        ///< false: recorded tracks
};

class FlightView {
 public:
  virtual ~FlightView() = default;

  /// Once, before the threads of the flight are armed. False: the system has no thread left.
  virtual bool start(ViewSubject subject) = 0;
  /// To be told of the flight.
  virtual FlightObserver& observer() = 0;
  /// The flight is over: what the observer was told is all. After the last call of the observer.
  virtual void finish() = 0;
};

}  // namespace epiline
