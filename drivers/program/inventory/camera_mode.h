#pragma once
// Chooses the camera, format, size and rate that suit odometry best.
#include <optional>
#include <vector>

#include "drivers/program/inventory/parts.h"

namespace epiline {

struct CameraMode {
  const CameraPart* camera = nullptr;
  const CameraFormat* format = nullptr;
  unsigned width = 0, height = 0;
  double rate_hz = 0;  ///< 0: the driver does not list its rates
};

/// In this order: a rate of 20 Hz or more; a grey format, because sensors of odometry are grey and mostly have a global
/// shutter; a size from 640x400 to 1280x800; a rate of 20 to 30 Hz; a size near 640x480. Nothing if no camera has a
/// format that epiline reads, or may be opened.
std::optional<CameraMode> choose_mode(const std::vector<CameraPart>& cameras);

/// The sensor behind the format is grey: no colour filter, mostly a global shutter.
bool is_grey(const CameraFormat& format);

}  // namespace epiline
