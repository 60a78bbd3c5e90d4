#pragma once
// Who sees what a check looks at while it goes on: its page.
#include "drivers/program/check/finding.h"
#include "platform/samples/samples.h"

namespace epiline {

class CheckWitness {
 public:
  virtual ~CheckWitness() = default;

  /// The camera's thread: an image and what was tracked in it, lent for this call. `edge_px`: width of its strong
  /// edges; 0: there are none.
  virtual void image(const Frame& frame, const TrackedFrame& tracked, double edge_px) = 0;
  /// The IMU's thread.
  virtual void reading(const ImuSample& sample) = 0;
  /// About once a second: what would be said if the check ended now.
  virtual void findings(double seconds, const Findings& findings) = 0;
  /// True once after the wish to forget what was seen until now.
  virtual bool takes_new_start() = 0;
};

}  // namespace epiline
