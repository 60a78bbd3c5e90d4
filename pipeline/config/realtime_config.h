#pragma once

namespace epiline {

/// Section [realtime]: how the threads run. Priorities are SCHED_FIFO's, 0 the ordinary scheduler; cpu -1: any.
struct RealtimeConfig {
  double deadline_ms = 50;  ///< from an image's stamp to its odometry; 0: as long as it takes
  double imu_wait_ms = 100;
  int priority_imu = 80, priority_capture = 70, priority_publish = 65, priority_track = 60, priority_estimate = 60;
  int cpu_imu = -1, cpu_capture = -1, cpu_publish = -1, cpu_track = -1, cpu_estimate = -1;
  bool lock_memory = true;
};

}  // namespace epiline
