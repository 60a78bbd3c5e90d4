#pragma once
// Two cameras whose images come side by side in one, as stereo boards and stereo USB cameras give them. docs/camera.md.
#include <memory>

#include "platform/ports/ports.h"

namespace epiline {

/// The halves are lent where they are; they share a stamp, an exposure and a buffer.
class SideBySide final : public CameraSource {
 public:
  /// `right_is_first`: the first camera's image is the right half.
  SideBySide(std::unique_ptr<CameraSource> both, bool right_is_first)
      : both_(std::move(both)), right_is_first_(right_is_first) {}

  Status open() override { return both_->open(); }
  void close() noexcept override { both_->close(); }
  ReadOutcome read(Frame& frame, Span timeout) noexcept override {
    const ReadOutcome outcome = both_->read(frame, timeout);
    if (outcome != ReadOutcome::kSample) return outcome;
    frame.width /= 2;
    if (right_is_first_) frame.data += frame.width;
    return outcome;
  }
  OtherFrames others(const Frame& frame) const noexcept override {
    Frame second = frame;
    second.data += right_is_first_ ? -frame.width : frame.width;
    return {second};
  }
  void give_back(const Frame& frame) noexcept override { both_->give_back(frame); }

 private:
  std::unique_ptr<CameraSource> both_;
  bool right_is_first_;
};

}  // namespace epiline
