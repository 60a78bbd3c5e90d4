#include "drivers/sensors/camera/side_by_side.h"

namespace epiline {

ReadOutcome SideBySide::read(Frame& frame, Span timeout) noexcept {
  const ReadOutcome outcome = both_->read(frame, timeout);
  if (outcome != ReadOutcome::kSample) return outcome;
  frame.width /= 2;
  if (right_is_first_) frame.data += frame.width;
  return outcome;
}

OtherFrames SideBySide::others(const Frame& frame) const noexcept {
  Frame second = frame;
  second.data += right_is_first_ ? -frame.width : frame.width;
  return {second};
}

}  // namespace epiline
