#include "pipeline/config/config.h"

#include <algorithm>

namespace epiline {

namespace {

constexpr double kNoLimit = 1e12;

Choice visual_factors() {
  return {{kVisualFactorNames.begin(), kVisualFactorNames.end()},
          [](const Config& c) { return static_cast<int>(c.estimator.visual_factor); },
          [](Config& c, int i) { c.estimator.visual_factor = static_cast<VisualFactor>(i); }};
}

Choice keyframe_rules() {
  return {{"compensated-parallax", "raw-parallax"},
          [](const Config& c) { return static_cast<int>(c.estimator.keyframe_rule); },
          [](Config& c, int i) { c.estimator.keyframe_rule = static_cast<KeyframeRule>(i); }};
}

}  // namespace

std::optional<VisualFactor> visual_factor_from(const std::string& name) {
  const auto* const found = std::find(kVisualFactorNames.begin(), kVisualFactorNames.end(), name);
  if (found == kVisualFactorNames.end()) return std::nullopt;
  return static_cast<VisualFactor>(found - kVisualFactorNames.begin());
}

#define EPILINE_AT(member) [](Config& c) { return &c.member; }
#define EPILINE_CHOICE(member, choices)                                                 \
  Choice {                                                                              \
    {std::begin(choices), std::end(choices)}, [](const Config& c) { return c.member; }, \
        [](Config& c, int i) { c.member = i; }                                          \
  }

const std::vector<Parameter>& parameters() {
  static const std::vector<Parameter> table = {
      // estimator
      {"estimator.visual_factor", "", 0, 0, "residual of a track", visual_factors()},
      {"estimator.keyframes", "", 2, 20, "older images in the window", EPILINE_AT(estimator.keyframes)},
      {"estimator.solve_interval_s", "s", 0, 10, "at most one solved image per interval; the others are predicted",
       EPILINE_AT(estimator.solve_interval_s)},
      {"estimator.steps", "", 1, 20, "accepted solver steps per image at most", EPILINE_AT(estimator.steps)},
      {"estimator.steps_young", "", 1, 20, "the same after a start or a rejected step",
       EPILINE_AT(estimator.steps_young)},
      {"estimator.pixel_sigma", "px", 0.01, 20,
       "noise of a track in one image: first guess, or the value if not estimated", EPILINE_AT(estimator.pixel_sigma)},
      {"estimator.estimate_pixel_sigma", "", 0, 0, "estimate the noise from the residuals",
       EPILINE_AT(estimator.estimate_pixel_sigma)},
      {"estimator.sigma_inflation", "", 0.1, 10, "scale of the covariance over the scale of the robust kernel",
       EPILINE_AT(estimator.sigma_inflation)},
      {"estimator.cauchy", "", 0.1, 100, "scale of the robust kernel, in sigmas", EPILINE_AT(estimator.cauchy)},
      {"estimator.gate", "", 0, 0, "leave out tracks that contradict the motion", EPILINE_AT(estimator.gate)},
      {"estimator.gate_cap", "", 0, 1, "an image that would lose a larger share of its tracks loses none",
       EPILINE_AT(estimator.gate_cap)},
      {"estimator.gyroscope_density_factor", "", 0.1, 100, "on the gyroscope's noise: covers scale and misalignment",
       EPILINE_AT(estimator.gyroscope_density_factor)},
      {"estimator.accelerometer_density_factor", "", 0.1, 100, "on the accelerometer's noise",
       EPILINE_AT(estimator.accelerometer_density_factor)},
      {"estimator.keyframe_rule", "", 0, 0, "what makes a keyframe", keyframe_rules()},
      {"estimator.keyframe_parallax_px", "px", 0.1, 200, "mean parallax that makes one",
       EPILINE_AT(estimator.keyframe_parallax_px)},
      {"estimator.zero_motion", "", 0, 0, "use standstill as a measurement", EPILINE_AT(estimator.zero_motion)},
      {"estimator.estimate_time_offset", "", 0, 0, "estimate t_IMU - t_image",
       EPILINE_AT(estimator.estimate_time_offset)},
      {"estimator.time_offset_sigma_s", "s", 1e-6, 1, "uncertainty of the first guess of it",
       EPILINE_AT(estimator.time_offset_sigma_s)},
      {"estimator.estimate_extrinsics", "", 0, 0, "estimate where the camera sits on the body",
       EPILINE_AT(estimator.estimate_extrinsics)},
      {"estimator.extrinsic_rotation_sigma_rad", "rad", 1e-6, 1, "uncertainty of the calibrated rotation",
       EPILINE_AT(estimator.extrinsic_rotation_sigma_rad)},
      {"estimator.extrinsic_translation_sigma_m", "m", 1e-6, 1, "uncertainty of the calibrated translation",
       EPILINE_AT(estimator.extrinsic_translation_sigma_m)},
      {"estimator.deadline_ms", "ms", 0, 1e4, "time for the solve of one image; 0: as long as it takes",
       EPILINE_AT(deadline_ms)},
      // tracker
      {"tracker.max_features", "", 1, 400, "tracks to keep alive", EPILINE_AT(tracker.max_features)},
      {"tracker.levels", "", 1, 6, "of the image pyramid", EPILINE_AT(tracker.levels)},
      {"tracker.iterations", "", 1, 100, "of a track's search on one level, at most", EPILINE_AT(tracker.iterations)},
      {"tracker.step_px", "px", 0.001, 1, "a search has converged below this step", EPILINE_AT(tracker.step_px)},
      {"tracker.coarse_step_px", "px", 0.001, 1, "the same on the coarser levels", EPILINE_AT(tracker.coarse_step_px)},
      {"tracker.max_step_px", "px", 0.5, 100, "a longer step is divergence", EPILINE_AT(tracker.max_step_px)},
      {"tracker.min_eigenvalue", "(grey/px)^2", 0, 1000, "texture a track needs, per pixel",
       EPILINE_AT(tracker.min_eigenvalue)},
      {"tracker.start_level_1_px", "px", 0, 100, "predicted better than this last time: search starts at level 1",
       EPILINE_AT(tracker.start_level_1_px)},
      {"tracker.start_level_2_px", "px", 0, 100, "predicted better than this last time: search starts at level 2",
       EPILINE_AT(tracker.start_level_2_px)},
      {"tracker.min_correlation", "", -1, 1, "between old and new patch", EPILINE_AT(tracker.min_correlation)},
      {"tracker.backward_iterations", "", 1, 100, "of the search back to the image before, at most",
       EPILINE_AT(tracker.backward_iterations)},
      {"tracker.max_backward_px", "px", 0.01, 100, "a track found back further away is lost",
       EPILINE_AT(tracker.max_backward_px)},
      {"tracker.hypotheses", "", 1, 1000, "directions of travel tried against outliers",
       EPILINE_AT(tracker.hypotheses)},
      {"tracker.min_pairs", "", 3, 400, "with fewer tracks none is rejected", EPILINE_AT(tracker.min_pairs)},
      {"tracker.near_limit_px", "px", 0.01, 100, "largest distance from the epipolar line, image to image",
       EPILINE_AT(tracker.near_limit_px)},
      {"tracker.wide_limit_px", "px", 0.01, 100, "the same over several images", EPILINE_AT(tracker.wide_limit_px)},
      {"tracker.wide_span", "images", 2, 7, "how many", EPILINE_AT(tracker.wide_span)},
      {"tracker.border_px", "px", 4, 1000, "no new features nearer to the border", EPILINE_AT(tracker.border_px)},
      {"tracker.cells_per_feature", "", 0.1, 10, "size of the detection grid", EPILINE_AT(tracker.cells_per_feature)},
      {"tracker.min_distance_px", "px", 1, 1000, "of a new feature from the others",
       EPILINE_AT(tracker.min_distance_px)},
      {"tracker.min_score", "(grey/px)^2", 0, 10000, "texture a new feature needs", EPILINE_AT(tracker.min_score)},
      // threads of a real-time run
      {"realtime.deadline_ms", "ms", 0, 1e4, "from an image's stamp to its odometry; 0: as long as it takes",
       EPILINE_AT(realtime.deadline_ms)},
      {"realtime.imu_wait_ms", "ms", 1, 1e4, "an image waits so long for its IMU readings, at most",
       EPILINE_AT(realtime.imu_wait_ms)},
      {"realtime.lock_memory", "", 0, 0, "keep all memory of the process in physical memory",
       EPILINE_AT(realtime.lock_memory)},
      {"realtime.priority_imu", "", 0, 99, "SCHED_FIFO priority of the IMU's thread; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_imu)},
      {"realtime.priority_capture", "", 0, 99, "SCHED_FIFO priority of the camera's thread; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_capture)},
      {"realtime.priority_publish", "", 0, 99,
       "SCHED_FIFO priority of the thread that hands odometry out; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_publish)},
      {"realtime.priority_track", "", 0, 99, "SCHED_FIFO priority of the tracker's thread; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_track)},
      {"realtime.priority_estimate", "", 0, 99, "SCHED_FIFO priority of the estimator's thread; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_estimate)},
      {"realtime.cpu_imu", "", -1, 1023, "the one processor of the IMU's thread; -1: any",
       EPILINE_AT(realtime.cpu_imu)},
      {"realtime.cpu_capture", "", -1, 1023, "the one processor of the camera's thread; -1: any",
       EPILINE_AT(realtime.cpu_capture)},
      {"realtime.cpu_publish", "", -1, 1023, "the one processor of the thread that hands odometry out; -1: any",
       EPILINE_AT(realtime.cpu_publish)},
      {"realtime.cpu_track", "", -1, 1023, "the one processor of the tracker's thread; -1: any",
       EPILINE_AT(realtime.cpu_track)},
      {"realtime.cpu_estimate", "", -1, 1023, "the one processor of the estimator's thread; -1: any",
       EPILINE_AT(realtime.cpu_estimate)},
      // flight recorder of a real-time run
      {"recorder.folder", "", 0, 0, "records go here; without it there is no recorder", EPILINE_AT(recorder.folder)},
      {"recorder.seconds", "s", 1, 3600, "of IMU, tracks, states and events to keep", EPILINE_AT(recorder.seconds)},
      {"recorder.images", "", 0, 0, "keep images as well", EPILINE_AT(recorder.images)},
      {"recorder.image_memory_mib", "MiB", 1, 65536, "memory for them; it may hold fewer seconds than the rest",
       EPILINE_AT(recorder.image_memory_mib)},
      {"recorder.on_lost", "", 0, 0, "write a record when the estimate is lost, or reset",
       EPILINE_AT(recorder.on_lost)},
      {"recorder.after_lost_s", "s", 0, 60, "how long after that", EPILINE_AT(recorder.after_lost_s)},
      {"recorder.pause_s", "s", 0, 1e6, "between two records for that reason, at least", EPILINE_AT(recorder.pause_s)},
      {"recorder.most", "", 0, 1000, "records for that reason in a run, at most", EPILINE_AT(recorder.most)},
      // camera; without these, what the data set says
      {"camera.calibration", "", 0, 0,
       "calibration file (ASL or Kalibr) instead of the data set's; seen from the current folder",
       EPILINE_AT(camera_calibration)},
      {"camera.device", "", 0, 0, "path, name or bus of a live camera, as v4l2-ctl --list-devices shows them",
       EPILINE_AT(devices.camera.device)},
      {"camera.width", "px", 0, 16384, "0: as the device is set", EPILINE_AT(devices.camera.width)},
      {"camera.height", "px", 0, 16384, "0: as the device is set", EPILINE_AT(devices.camera.height)},
      {"camera.rate_hz", "Hz", 0, 1000, "0: as the device is set", EPILINE_AT(devices.camera.rate_hz)},
      {"camera.format", "", 0, 0, "GREY, NV12, YU12, Y10P, Y10, Y12, Y16 or YUYV; without it the best there is",
       EPILINE_AT(devices.camera.format)},
      {"camera.buffers", "", 2, 16, "images the driver has room for", EPILINE_AT(devices.camera.buffers)},
      {"camera.controls", "", 0, 0, "set in this order, then read back; names as v4l2-ctl --list-ctrls shows them",
       EPILINE_AT(devices.camera.controls)},
      {"camera.shutter", "", 0, 0, "how the sensor exposes its rows",
       EPILINE_CHOICE(devices.camera.shutter, kShutterNames)},
      {"camera.readout_ms", "ms", 0, 1000, "from the first row's arrival to the last one's",
       EPILINE_AT(devices.camera.readout_ms)},
      {"camera.exposure_ms", "ms", 0, 1000, "exposure time, if no control tells it",
       EPILINE_AT(devices.camera.exposure_ms)},
      {"camera.exposure_control", "", 0, 0, "the control that tells it", EPILINE_AT(devices.camera.exposure_control)},
      {"camera.exposure_unit_ms", "ms", 1e-6, 1000, "what 1 in that control means",
       EPILINE_AT(devices.camera.exposure_unit_ms)},
      {"camera.stamp_point", "", 0, 0, "what the driver's stamps are of",
       EPILINE_CHOICE(devices.camera.stamp_point, kStampPointNames)},
      {"camera.trust_stamps", "", 0, 0, "stamps are monotonic though the driver does not say so",
       EPILINE_AT(devices.camera.trust_stamps)},
      {"camera.silence_ms", "ms", 0, 1e6, "without an image so long the device is opened anew; 0: never",
       EPILINE_AT(devices.camera.silence_ms)},
      {"camera.stamp_line", "", 0, 0, "GPIO line, by name or CHIP:OFFSET, with an edge at each exposure's start",
       EPILINE_AT(devices.camera.stamp_line)},
      {"camera.stamp_edge", "", 0, 0, "which edge", EPILINE_CHOICE(devices.camera.stamp_edge, kEdgeNames)},
      {"camera.time_offset_s", "s", -1, 1, "first guess of t_IMU - t_image",
       EPILINE_AT(estimator.extrinsics.time_offset_s)},
      // IMU; without these, what the data set says
      {"imu.calibration", "", 0, 0,
       "calibration file (ASL or Kalibr) instead of the data set's; seen from the current folder",
       EPILINE_AT(imu_calibration)},
      {"imu.driver", "", 0, 0, "where readings come from", EPILINE_CHOICE(devices.imu.driver, kImuDriverNames)},
      {"imu.device", "", 0, 0, "iio: name or path; spi: /dev/spidevB.C (bmi088: its gyroscope)",
       EPILINE_AT(devices.imu.device)},
      {"imu.device_accel", "", 0, 0, "the accelerometer, where it is a device of its own",
       EPILINE_AT(devices.imu.device_accel)},
      {"imu.trigger", "", 0, 0, "iio: name of a trigger; without it the one that is set, or the device's own",
       EPILINE_AT(devices.imu.trigger)},
      {"imu.rate_hz", "Hz", 1, 10000, "readings per second to ask for", EPILINE_AT(devices.imu.rate_hz)},
      {"imu.ready_line", "", 0, 0, "GPIO line, by name or CHIP:OFFSET, with the data-ready edge",
       EPILINE_AT(devices.imu.ready_line)},
      {"imu.ready_edge", "", 0, 0, "which edge", EPILINE_CHOICE(devices.imu.ready_edge, kEdgeNames)},
      {"imu.delay_ms", "ms", 0, 100, "from the instant of a reading to its stamp: filters, transport",
       EPILINE_AT(devices.imu.delay_ms)},
      {"imu.spi_hz", "Hz", 0, 1e8, "clock of the SPI bus; 0: the chip's", EPILINE_AT(devices.imu.spi_hz)},
      {"imu.gyroscope_range_deg_s", "deg/s", 1, 1e5, "measuring range; the next larger one the chip has",
       EPILINE_AT(devices.imu.gyroscope_range_deg_s)},
      {"imu.accelerometer_range_m_s2", "m/s^2", 1, 1e5, "measuring range; the next larger one the chip has",
       EPILINE_AT(devices.imu.accelerometer_range_m_s2)},
      {"imu.gyroscope_noise_density", "rad/s/sqrt(Hz)", 1e-9, 1, "white noise",
       EPILINE_AT(estimator.imu.gyroscope_density)},
      {"imu.gyroscope_random_walk", "rad/s^2/sqrt(Hz)", 1e-12, 1, "walk of the bias",
       EPILINE_AT(estimator.imu.gyroscope_random_walk)},
      {"imu.accelerometer_noise_density", "m/s^2/sqrt(Hz)", 1e-9, 10, "white noise",
       EPILINE_AT(estimator.imu.accelerometer_density)},
      {"imu.accelerometer_random_walk", "m/s^3/sqrt(Hz)", 1e-12, 10, "walk of the bias",
       EPILINE_AT(estimator.imu.accelerometer_random_walk)},
      {"imu.gyroscope_saturation", "rad/s", 0.1, kNoLimit, "readings from here on are cut off",
       EPILINE_AT(estimator.saturation_gyroscope_rad_s)},
      {"imu.accelerometer_saturation", "m/s^2", 1, kNoLimit, "readings from here on are cut off",
       EPILINE_AT(estimator.saturation_accelerometer_m_s2)},
      // how the IMU sits in the vehicle
      {"body.roll_deg", "deg", -180, 180, "turns the vehicle's axes (forward, left, up) into the IMU's: third, about x",
       EPILINE_AT(devices.body.roll_deg)},
      {"body.pitch_deg", "deg", -180, 180, "second, about y", EPILINE_AT(devices.body.pitch_deg)},
      {"body.yaw_deg", "deg", -180, 180, "first, about z", EPILINE_AT(devices.body.yaw_deg)},
      // a flight controller
      {"mavlink.serial", "", 0, 0, "device file of the line to the flight controller",
       EPILINE_AT(devices.mavlink.serial)},
      {"mavlink.baud", "", 1200, 4e6, "of that line", EPILINE_AT(devices.mavlink.baud)},
      {"mavlink.udp", "", 0, 0, "ADDRESS:PORT of the flight controller, instead of a serial line",
       EPILINE_AT(devices.mavlink.udp)},
      {"mavlink.udp_listen", "", 0, 0, "ADDRESS:PORT to send from and to be spoken to; without it any free port",
       EPILINE_AT(devices.mavlink.udp_listen)},
      {"mavlink.system", "", 1, 255, "MAVLink's number of the vehicle", EPILINE_AT(devices.mavlink.system)},
      {"mavlink.component", "", 1, 255, "MAVLink's number of epiline in it", EPILINE_AT(devices.mavlink.component)},
      {"mavlink.rate_hz", "Hz", 4, 100, "odometry messages per second", EPILINE_AT(devices.mavlink.rate_hz)},
      {"mavlink.message", "", 0, 0, "what the odometry travels in",
       EPILINE_CHOICE(devices.mavlink.message, kMavlinkMessageNames)},
      // a CAN bus
      {"can.interface", "", 0, 0, "network interface that odometry goes out to", EPILINE_AT(devices.can.interface)},
      {"can.fd", "", 0, 0, "CAN FD frames; false: classic ones", EPILINE_AT(devices.can.fd)},
      {"can.base_id", "", 1, 0x7f0, "the first identifier; those after it are used too",
       EPILINE_AT(devices.can.base_id)},
      {"can.rate_hz", "Hz", 1, 200, "odometry per second", EPILINE_AT(devices.can.rate_hz)},
      {"can.isotp_send_id", "", 0, 0x7ff, "identifier of whole MAVLink frames by ISO-TP; 0: none",
       EPILINE_AT(devices.can.isotp_send_id)},
      {"can.isotp_receive_id", "", 0, 0x7ff, "identifier of the peer's ISO-TP frames",
       EPILINE_AT(devices.can.isotp_receive_id)},
      // speed of a ground vehicle
      {"wheel.interface", "", 0, 0, "network interface of a CAN bus that carries the vehicle's speed",
       EPILINE_AT(devices.wheel.interface)},
      {"wheel.id", "", 0, 0x1fffffff, "identifier of the frame", EPILINE_AT(devices.wheel.id)},
      {"wheel.extended", "", 0, 0, "the identifier has 29 bits", EPILINE_AT(devices.wheel.extended)},
      {"wheel.start_bit", "", 0, 511, "of the signal, as a DBC file counts", EPILINE_AT(devices.wheel.start_bit)},
      {"wheel.length", "bit", 1, 64, "of the signal", EPILINE_AT(devices.wheel.length)},
      {"wheel.big_endian", "", 0, 0, "byte order (DBC: @0)", EPILINE_AT(devices.wheel.big_endian)},
      {"wheel.is_signed", "", 0, 0, "(DBC: -)", EPILINE_AT(devices.wheel.is_signed)},
      {"wheel.scale_m_s", "m/s", -1e6, 1e6, "what 1 in the signal means", EPILINE_AT(devices.wheel.scale_m_s)},
      {"wheel.offset_m_s", "m/s", -1e6, 1e6, "what 0 in the signal means", EPILINE_AT(devices.wheel.offset_m_s)},
      {"wheel.sigma_m_s", "m/s", 1e-4, 100, "uncertainty of the speed", EPILINE_AT(devices.wheel.sigma_m_s)},
  };
  return table;
}

#undef EPILINE_AT
#undef EPILINE_CHOICE

}  // namespace epiline
