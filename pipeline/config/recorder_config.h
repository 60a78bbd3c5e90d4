#pragma once
#include <string>

namespace epiline {

/// Section [recorder]: the flight recorder.
struct RecorderConfig {
  std::string folder;  ///< of the records; empty: no recorder
  double seconds = 30;
  bool images = false;
  int image_memory_mib = 256;
  int keep = 50;  ///< records in the folder: the oldest are removed; 0: all stay
  // Not settings: of the records that it makes by itself when the estimate is lost or reset.
  double after_lost_s = 3;  ///< recording continues for this time before it writes: shows how the loss goes on
  double pause_s = 60;      ///< between two of them, so that a vehicle that stays lost does not fill the disk
  int most = 20;            ///< in a run
};

}  // namespace epiline
