#pragma once
#include <string>

namespace epiline {

/// Section [recorder]: the flight recorder.
struct RecorderConfig {
  std::string folder;  ///< of the records; empty: no recorder
  double seconds = 30;
  bool images = false;
  int image_memory_mib = 256;
  bool on_lost = true;
  double after_lost_s = 3;  ///< recording continues for this time before it writes
  double pause_s = 60;      ///< between two records it makes by itself
  int most = 20;            ///< records it makes by itself in a run
  int keep = 50;            ///< records in the folder: the oldest are removed; 0: all stay
};

}  // namespace epiline
