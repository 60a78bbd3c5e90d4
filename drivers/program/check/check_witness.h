#pragma once
// Receives the data of a running check: the interface of its page.
#include "drivers/program/check/finding.h"
#include "platform/samples/samples.h"

namespace epiline {

class CheckWitness {
 public:
  virtual ~CheckWitness() = default;

  /// Called by the camera's thread. Image and tracks are valid during this call only. `edge_px`: width of the image's
  /// strong edges; 0: there are none.
  virtual void image(const Frame& frame, const TrackedFrame& tracked, double edge_px) = 0;
  /// Called by the IMU's thread.
  virtual void reading(const ImuSample& sample) = 0;
  /// Called about once a second with the findings so far.
  virtual void findings(double seconds, const Findings& findings) = 0;
  /// True once after each request to discard all data collected so far.
  virtual bool takes_new_start() = 0;
};

}  // namespace epiline
