#pragma once
// The interface of a live view, as a replay uses it.
#include <optional>
#include <string>

#include "estimator/geometry/types.h"
#include "pipeline/realtime/flight_observer.h"

namespace epiline {

/// Facts about the whole run.
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
  /// Gets the events of the flight.
  virtual FlightObserver& observer() = 0;
  /// The flight is over. Called after the last call of the observer.
  virtual void finish() = 0;
};

}  // namespace epiline
