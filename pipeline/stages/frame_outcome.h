#pragma once
#include <cstdint>

#include "pipeline/stages/back_end.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Everything that came of one image; plain data, it travels through rings.
struct FrameOutcome {
  std::uint64_t serial = 0;  ///< of the images that were estimated, from 0
  HostStamp stamp;
  StepResult result;
  bool keyframe = false;  ///< a frame has become a keyframe
  Odometry odometry;
  int tracks = 0, new_tracks = 0;
  StageTime track;  ///< 0 with recorded tracks
  BackEnd::Times times;
};

/// Fills in the tracks of the image, and what the estimator made of them.
inline void describe(const TrackedFrame& tracked, const StepResult& result, bool keyframe, const BackEnd& back_end,
                     FrameOutcome& out) noexcept {
  out.stamp = tracked.stamp;
  out.result = result;
  out.keyframe = keyframe;
  out.odometry = back_end.odometry();
  out.times = back_end.times();
  out.tracks = static_cast<int>(tracked.features.size());
  out.new_tracks = 0;
  for (const TrackedFeature& feature : tracked.features) out.new_tracks += feature.age == 0;
}

}  // namespace epiline
