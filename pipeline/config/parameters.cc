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

Choice track_noises() {
  return {{kTrackNoiseNames.begin(), kTrackNoiseNames.end()},
          [](const Config& c) { return static_cast<int>(c.estimator.track_noise); },
          [](Config& c, int i) { c.estimator.track_noise = static_cast<TrackNoiseModel>(i); }};
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

// A live camera beside the first one; what is not here is as in [camera].
#define EPILINE_OTHER_CAMERA(nth, in_chain, i)                                                                      \
  {nth "_camera.device",                                                                                            \
   "",                                                                                                              \
   0,                                                                                                               \
   0,                                                                                                               \
   "path, name or bus of a " nth " camera beside the first one; default: none",                                     \
   EPILINE_AT(devices.other_cameras[i].device)},                                                                    \
      {nth "_camera.sensor",                                                                                        \
       "",                                                                                                          \
       0,                                                                                                           \
       0,                                                                                                           \
       "part of the sensor's name in the media graph",                                                              \
       EPILINE_AT(devices.other_cameras[i].sensor)},                                                                \
      {nth "_camera.stamp_line",                                                                                    \
       "",                                                                                                          \
       0,                                                                                                           \
       0,                                                                                                           \
       "GPIO line with an edge at the start of each of its exposures",                                              \
       EPILINE_AT(devices.other_cameras[i].stamp_line)},                                                            \
      {nth "_camera.calibration",                                                                                   \
       "",                                                                                                          \
       0,                                                                                                           \
       0,                                                                                                           \
       "its calibration file (ASL or Kalibr, there as " in_chain "); default: " in_chain " of camera.calibration",  \
       EPILINE_AT(devices.other_cameras[i].calibration)},                                                           \
      {nth "_camera.free_running",                                                                                  \
       "",                                                                                                          \
       0,                                                                                                           \
       0,                                                                                                           \
       "it is not triggered together with the first one: each of its images has its own time",                      \
       EPILINE_AT(devices.other_cameras[i].free_running)},                                                          \
  {                                                                                                                 \
    nth "_camera.within_ms", "ms", 0, 100,                                                                          \
        "images of both cameras are taken together if their times differ by no more; 0: by 1 ms; free-running: by " \
        "half"                                                                                                      \
        " a period of camera.rate_hz",                                                                              \
        EPILINE_AT(devices.other_cameras[i].within_ms)                                                              \
  }

const std::vector<Parameter>& parameters() {
  static const std::vector<Parameter> table = {
      // estimator
      {"estimator.visual_factor", "", 0, 0, "visual factor: which residual a track becomes", visual_factors()},
      {"estimator.keyframes", "", 2, 20, "number of older images in the window", EPILINE_AT(estimator.keyframes)},
      {"estimator.solve_interval_s", "s", 0, 10, "solve at most one image per interval; the IMU predicts the others",
       EPILINE_AT(estimator.solve_interval_s)},
      {"estimator.steps", "", 1, 20, "largest number of accepted solver steps per image", EPILINE_AT(estimator.steps)},
      {"estimator.steps_young", "", 1, 20, "the same, after a start or a rejected step",
       EPILINE_AT(estimator.steps_young)},
      {"estimator.pixel_sigma", "px", 0.01, 20,
       "noise of a track in one image: initial value if estimated, else the value", EPILINE_AT(estimator.pixel_sigma)},
      {"estimator.estimate_pixel_sigma", "", 0, 0, "estimate pixel_sigma from the residuals",
       EPILINE_AT(estimator.estimate_pixel_sigma)},
      {"estimator.sigma_inflation", "", 0.1, 10, "inflation of the track noise in the covariance",
       EPILINE_AT(estimator.sigma_inflation)},
      {"estimator.cauchy", "", 0.1, 100, "scale of the Cauchy kernel against outliers, in sigmas",
       EPILINE_AT(estimator.cauchy)},
      {"estimator.track_noise", "", 0, 0, "error of a track: new in each image (white), or adding up (drift)",
       track_noises()},
      {"estimator.drift_sigma", "px", 0.01, 20, "drift of a track from image to image: initial value if estimated",
       EPILINE_AT(estimator.drift_sigma)},
      {"estimator.drift_inflation", "", 0.1, 10, "ratio of the sigmas of a drifting track's covariance and weight",
       EPILINE_AT(estimator.drift_inflation)},
      {"estimator.drift_student", "", 0.5, 1000, "degrees of freedom of a drifting track's weight",
       EPILINE_AT(estimator.drift_student)},
      {"estimator.gate", "", 0, 0, "gate: leave out tracks that contradict the motion", EPILINE_AT(estimator.gate)},
      {"estimator.gate_cap", "", 0, 1, "an image of which the gate would leave out a larger share loses none",
       EPILINE_AT(estimator.gate_cap)},
      {"estimator.gyroscope_density_factor", "", 0.1, 100,
       "factor on the gyroscope's noise density, for scale and axis errors",
       EPILINE_AT(estimator.gyroscope_density_factor)},
      {"estimator.accelerometer_density_factor", "", 0.1, 100, "factor on the accelerometer's noise density",
       EPILINE_AT(estimator.accelerometer_density_factor)},
      {"estimator.accelerometer_walk_factor", "", 0.1, 100,
       "factor on the random walk of the accelerometer's bias, which is faster in flight than on a table",
       EPILINE_AT(estimator.accelerometer_walk_factor)},
      {"estimator.keyframe_rule", "", 0, 0, "which parallax makes an image a keyframe", keyframe_rules()},
      {"estimator.keyframe_parallax_px", "px", 0.1, 200, "mean parallax that makes an image a keyframe",
       EPILINE_AT(estimator.keyframe_parallax_px)},
      {"estimator.zero_motion", "", 0, 0, "use standstill as a measurement", EPILINE_AT(estimator.zero_motion)},
      {"estimator.estimate_time_offset", "", 0, 0, "estimate the time offset t_IMU - t_image",
       EPILINE_AT(estimator.estimate_time_offset)},
      {"estimator.time_offset_sigma_s", "s", 1e-6, 1, "standard deviation of the initial time offset",
       EPILINE_AT(estimator.time_offset_sigma_s)},
      {"estimator.estimate_extrinsics", "", 0, 0, "estimate the pose of the camera on the IMU",
       EPILINE_AT(estimator.estimate_extrinsics)},
      {"estimator.extrinsic_rotation_sigma_rad", "rad", 1e-6, 1, "standard deviation of the calibrated rotation",
       EPILINE_AT(estimator.extrinsic_rotation_sigma_rad)},
      {"estimator.extrinsic_translation_sigma_m", "m", 1e-6, 1, "standard deviation of the calibrated translation",
       EPILINE_AT(estimator.extrinsic_translation_sigma_m)},
      {"estimator.estimate_focal_length", "", 0, 0, "estimate the focal length",
       EPILINE_AT(estimator.estimate_focal_length)},
      {"estimator.focal_length_sigma", "", 1e-6, 1, "relative standard deviation of the calibrated focal length",
       EPILINE_AT(estimator.focal_length_sigma)},
      {"estimator.estimate_imu_scale", "", 0, 0, "estimate the scales of accelerometer and gyroscope",
       EPILINE_AT(estimator.estimate_imu_scale)},
      {"estimator.accelerometer_scale_sigma", "", 1e-6, 1, "relative standard deviation of the accelerometer's scale",
       EPILINE_AT(estimator.accelerometer_scale_sigma)},
      {"estimator.gyroscope_scale_sigma", "", 1e-6, 1, "relative standard deviation of the gyroscope's scale",
       EPILINE_AT(estimator.gyroscope_scale_sigma)},
      {"estimator.deadline_ms", "ms", 0, 1e4, "longest time for the solve of one image; 0: no limit",
       EPILINE_AT(deadline_ms)},
      // tracker
      {"tracker.max_features", "", 1, 400, "number of tracks to maintain", EPILINE_AT(tracker.max_features)},
      {"tracker.second_features", "", 0, 400,
       "tracks of a second camera alone; where the first one loses half of its own, as many as it lacks; 0: none, ever",
       EPILINE_AT(tracker.second_features)},
      {"tracker.levels", "", 1, 6, "levels of the image pyramid", EPILINE_AT(tracker.levels)},
      {"tracker.iterations", "", 1, 100, "largest number of iterations of a search on one level",
       EPILINE_AT(tracker.iterations)},
      {"tracker.step_px", "px", 0.001, 1, "a search has converged when its step is below this",
       EPILINE_AT(tracker.step_px)},
      {"tracker.coarse_step_px", "px", 0.001, 1, "the same, on the coarser levels", EPILINE_AT(tracker.coarse_step_px)},
      {"tracker.max_step_px", "px", 0.5, 100, "a search has diverged when its step is above this",
       EPILINE_AT(tracker.max_step_px)},
      {"tracker.min_eigenvalue", "(grey/px)^2", 0, 1000, "least texture for tracking, per pixel (smaller eigenvalue)",
       EPILINE_AT(tracker.min_eigenvalue)},
      {"tracker.start_level_0_px", "px", 0, 100, "search level 0 only if the last prediction was better than this",
       EPILINE_AT(tracker.start_level_0_px)},
      {"tracker.start_level_1_px", "px", 0, 100,
       "start the search at level 1 if the last prediction was better than this", EPILINE_AT(tracker.start_level_1_px)},
      {"tracker.start_level_2_px", "px", 0, 100,
       "start the search at level 2 if the last prediction was better than this", EPILINE_AT(tracker.start_level_2_px)},
      {"tracker.min_correlation", "", -1, 1, "least correlation between old and new patch",
       EPILINE_AT(tracker.min_correlation)},
      {"tracker.backward_iterations", "", 1, 100, "largest number of iterations of the backward search",
       EPILINE_AT(tracker.backward_iterations)},
      {"tracker.max_backward_px", "px", 0.01, 100, "a track is lost if the backward search ends farther away",
       EPILINE_AT(tracker.max_backward_px)},
      {"tracker.hypotheses", "", 1, 1000, "number of directions of travel to try for outlier rejection",
       EPILINE_AT(tracker.hypotheses)},
      {"tracker.min_pairs", "", 3, 400, "reject no outliers with fewer tracks than this",
       EPILINE_AT(tracker.min_pairs)},
      {"tracker.near_limit_px", "px", 0.01, 100,
       "outlier limit: distance from the epipolar line, between consecutive images", EPILINE_AT(tracker.near_limit_px)},
      {"tracker.wide_limit_px", "px", 0.01, 100, "the same, over wide_span images", EPILINE_AT(tracker.wide_limit_px)},
      {"tracker.wide_span", "images", 2, 7, "number of images for wide_limit_px", EPILINE_AT(tracker.wide_span)},
      {"tracker.border_px", "px", 4, 1000, "least distance of a new feature from the border",
       EPILINE_AT(tracker.border_px)},
      {"tracker.cells_per_feature", "", 0.1, 10, "cells of the detection grid per feature",
       EPILINE_AT(tracker.cells_per_feature)},
      {"tracker.min_distance_px", "px", 1, 1000, "least distance of a new feature from the others",
       EPILINE_AT(tracker.min_distance_px)},
      {"tracker.min_score", "(grey/px)^2", 0, 10000, "least texture of a new feature (smaller eigenvalue)",
       EPILINE_AT(tracker.min_score)},
      // threads of a real-time run
      {"realtime.deadline_ms", "ms", 0, 1e4, "longest time from an image's timestamp to its odometry; 0: no limit",
       EPILINE_AT(realtime.deadline_ms)},
      {"realtime.imu_wait_ms", "ms", 1, 1e4, "longest time that an image waits for its IMU samples",
       EPILINE_AT(realtime.imu_wait_ms)},
      {"realtime.lock_memory", "", 0, 0, "lock the memory of the process", EPILINE_AT(realtime.lock_memory)},
      {"realtime.priority_imu", "", 0, 99, "SCHED_FIFO priority of the IMU's thread; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_imu)},
      {"realtime.priority_capture", "", 0, 99, "SCHED_FIFO priority of the camera's thread; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_capture)},
      {"realtime.priority_publish", "", 0, 99,
       "SCHED_FIFO priority of the thread that publishes odometry; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_publish)},
      {"realtime.priority_track", "", 0, 99, "SCHED_FIFO priority of the tracker's thread; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_track)},
      {"realtime.priority_estimate", "", 0, 99, "SCHED_FIFO priority of the estimator's thread; 0: ordinary scheduling",
       EPILINE_AT(realtime.priority_estimate)},
      {"realtime.cpu_imu", "", -1, 1023, "processor for the IMU's thread; -1: any", EPILINE_AT(realtime.cpu_imu)},
      {"realtime.cpu_capture", "", -1, 1023, "processor for the camera's thread; -1: any",
       EPILINE_AT(realtime.cpu_capture)},
      {"realtime.cpu_publish", "", -1, 1023, "processor for the thread that publishes odometry; -1: any",
       EPILINE_AT(realtime.cpu_publish)},
      {"realtime.cpu_track", "", -1, 1023, "processor for the tracker's thread; -1: any",
       EPILINE_AT(realtime.cpu_track)},
      {"realtime.cpu_estimate", "", -1, 1023, "processor for the estimator's thread; -1: any",
       EPILINE_AT(realtime.cpu_estimate)},
      // flight recorder of a real-time run
      {"recorder.folder", "", 0, 0, "folder for records; without it there is no recorder", EPILINE_AT(recorder.folder)},
      {"recorder.seconds", "s", 1, 3600, "length of IMU samples, tracks, states and events to keep",
       EPILINE_AT(recorder.seconds)},
      {"recorder.images", "", 0, 0, "keep images as well", EPILINE_AT(recorder.images)},
      {"recorder.image_memory_mib", "MiB", 1, 65536, "memory for images; it may hold fewer seconds than the rest",
       EPILINE_AT(recorder.image_memory_mib)},
      {"recorder.on_lost", "", 0, 0, "write a record when the estimate is lost or reset", EPILINE_AT(recorder.on_lost)},
      {"recorder.after_lost_s", "s", 0, 60, "delay of that record", EPILINE_AT(recorder.after_lost_s)},
      {"recorder.pause_s", "s", 0, 1e6, "shortest time between two such records", EPILINE_AT(recorder.pause_s)},
      {"recorder.most", "", 0, 1000, "largest number of such records in a run", EPILINE_AT(recorder.most)},
      {"recorder.keep", "", 0, 1e6, "largest number of records in the folder: the oldest are removed; 0: no limit",
       EPILINE_AT(recorder.keep)},
      // camera; without these, what the data set says
      {"camera.calibration", "", 0, 0,
       "calibration file (ASL or Kalibr), instead of the data set's; relative to the current folder",
       EPILINE_AT(camera_calibration)},
      {"camera.device", "", 0, 0,
       "path, name or bus of the live camera, as v4l2-ctl --list-devices shows them, or its name in the media graph",
       EPILINE_AT(devices.camera.device)},
      {"camera.sensor", "", 0, 0, "part of the sensor's name in the media graph, if several lead to camera.device",
       EPILINE_AT(devices.camera.sensor)},
      {"camera.width", "px", 0, 16384,
       "of the grey image (of a colour mosaic half the camera's); 0: keep the device's setting",
       EPILINE_AT(devices.camera.width)},
      {"camera.height", "px", 0, 16384, "0: keep the device's setting", EPILINE_AT(devices.camera.height)},
      {"camera.rate_hz", "Hz", 0, 1000, "0: keep the device's setting", EPILINE_AT(devices.camera.rate_hz)},
      {"camera.format", "", 0, 0,
       "pixel format as v4l2-ctl shows it: GREY, NV12, YU12, YUYV, Y10, RGGB, pRAA, MJPG and others (docs/camera.md); "
       "default: the one that costs least",
       EPILINE_AT(devices.camera.format)},
      {"camera.buffers", "", 2, 16, "number of buffers of the driver", EPILINE_AT(devices.camera.buffers)},
      {"camera.controls", "", 0, 0, "controls to set, in this order; names as v4l2-ctl --list-ctrls shows them",
       EPILINE_AT(devices.camera.controls)},
      {"camera.shutter", "", 0, 0, "type of the sensor's shutter",
       EPILINE_CHOICE(devices.camera.shutter, kShutterNames)},
      {"camera.readout_ms", "ms", 0, 1000, "time from the arrival of the first row to that of the last",
       EPILINE_AT(devices.camera.readout_ms)},
      {"camera.exposure_ms", "ms", 0, 1000, "exposure time, if no control gives it",
       EPILINE_AT(devices.camera.exposure_ms)},
      {"camera.exposure_control", "", 0, 0, "control with the exposure time",
       EPILINE_AT(devices.camera.exposure_control)},
      {"camera.exposure_unit_ms", "ms", 1e-6, 1000, "exposure time of a value of 1 in exposure_control",
       EPILINE_AT(devices.camera.exposure_unit_ms)},
      {"camera.stamp_point", "", 0, 0,
       "what the driver's timestamps refer to; first-row: its arrival, as receivers of CSI stamp",
       EPILINE_CHOICE(devices.camera.stamp_point, kStampPointNames)},
      {"camera.trust_stamps", "", 0, 0, "accept timestamps as monotonic although the driver does not declare it",
       EPILINE_AT(devices.camera.trust_stamps)},
      {"camera.clock", "", 0, 0, "clock of the timestamps; device: the camera's own, from the metadata of USB cameras",
       EPILINE_CHOICE(devices.camera.clock, kCameraClockNames)},
      {"camera.clock_hz", "Hz", 0, 4e9, "ticks per second of the camera's own clock; 0: as its USB descriptors tell",
       EPILINE_AT(devices.camera.clock_hz)},
      {"camera.silence_ms", "ms", 0, 1e6, "reopen the device after this time without an image; 0: never",
       EPILINE_AT(devices.camera.silence_ms)},
      {"camera.stamp_line", "", 0, 0, "GPIO line with an edge at the start of each exposure: name or CHIP:OFFSET",
       EPILINE_AT(devices.camera.stamp_line)},
      {"camera.stamp_edge", "", 0, 0, "active edge of the line", EPILINE_CHOICE(devices.camera.stamp_edge, kEdgeNames)},
      {"camera.time_offset_s", "s", -1, 1, "initial time offset t_IMU - t_image",
       EPILINE_AT(estimator.extrinsics.time_offset_s)},
      {"camera.side_by_side", "", 0, 0,
       "each image holds those of two cameras side by side, as stereo boards give them: which half is the first camera",
       EPILINE_CHOICE(devices.camera.side_by_side, kSideBySideNames)},
      EPILINE_OTHER_CAMERA("second", "cam1", 0),
      EPILINE_OTHER_CAMERA("third", "cam2", 1),
      EPILINE_OTHER_CAMERA("fourth", "cam3", 2),
      // control of a live camera's exposure
      {"exposure.automatic", "", 0, 0,
       "control exposure and gain for tracking; needs camera.exposure_control in manual mode",
       EPILINE_AT(devices.camera.exposure.automatic)},
      {"exposure.shortest_ms", "ms", 1e-3, 1000, "shortest exposure time",
       EPILINE_AT(devices.camera.exposure.shortest_ms)},
      {"exposure.longest_ms", "ms", 1e-3, 1000, "longest exposure time; gain provides the rest",
       EPILINE_AT(devices.camera.exposure.longest_ms)},
      {"exposure.blur_px", "px", 0, 100, "largest motion blur by rotation; 0: no limit",
       EPILINE_AT(devices.camera.exposure.blur_px)},
      {"exposure.brightness", "", 30, 200, "mean grey value to aim at in images without texture",
       EPILINE_AT(devices.camera.exposure.brightness)},
      {"exposure.gain_control", "", 0, 0, "control with the gain; without it only the exposure time changes",
       EPILINE_AT(devices.camera.exposure.gain_control)},
      {"exposure.gain_unit", "", 1e-6, 1e6, "gain of a value of 1 in gain_control: a factor, or dB",
       EPILINE_AT(devices.camera.exposure.gain_unit)},
      {"exposure.gain_scale", "", 0, 0, "scale of gain_control",
       EPILINE_CHOICE(devices.camera.exposure.gain_scale, kGainScaleNames)},
      {"exposure.gain_most", "", 1, 1e4, "largest gain, as a factor", EPILINE_AT(devices.camera.exposure.gain_most)},
      {"exposure.delay_images", "", -1, 8, "number of images after a change that do not show it yet; -1: learn it",
       EPILINE_AT(devices.camera.exposure.delay_images)},
      {"exposure.flicker_hz", "Hz", 0, 1000,
       "flicker of the lamps, 100 or 120: long exposures become whole periods; 0: none",
       EPILINE_AT(devices.camera.exposure.flicker_hz)},
      // IMU; without these, what the data set says
      {"imu.calibration", "", 0, 0,
       "calibration file (ASL or Kalibr), instead of the data set's; relative to the current folder",
       EPILINE_AT(imu_calibration)},
      {"imu.driver", "", 0, 0, "source of the IMU samples", EPILINE_CHOICE(devices.imu.driver, kImuDriverNames)},
      {"imu.device", "", 0, 0, "iio: name or path; SPI: /dev/spidevB.C (bmi088: of its gyroscope)",
       EPILINE_AT(devices.imu.device)},
      {"imu.device_accel", "", 0, 0, "the accelerometer, if it is a device of its own",
       EPILINE_AT(devices.imu.device_accel)},
      {"imu.trigger", "", 0, 0, "iio: name of a trigger; default: the one that is set, else the device's own",
       EPILINE_AT(devices.imu.trigger)},
      {"imu.rate_hz", "Hz", 1, 10000, "samples per second", EPILINE_AT(devices.imu.rate_hz)},
      {"imu.ready_line", "", 0, 0, "GPIO line with the data-ready edge: name or CHIP:OFFSET",
       EPILINE_AT(devices.imu.ready_line)},
      {"imu.ready_edge", "", 0, 0, "active edge of the line", EPILINE_CHOICE(devices.imu.ready_edge, kEdgeNames)},
      {"imu.delay_ms", "ms", 0, 100, "delay from sampling to the timestamp, by filters and transport",
       EPILINE_AT(devices.imu.delay_ms)},
      {"imu.spi_hz", "Hz", 0, 1e8, "clock of the SPI bus; 0: the default of the chip", EPILINE_AT(devices.imu.spi_hz)},
      {"imu.gyroscope_range_deg_s", "deg/s", 1, 1e5, "measuring range; the chip's next larger one is used",
       EPILINE_AT(devices.imu.gyroscope_range_deg_s)},
      {"imu.accelerometer_range_m_s2", "m/s^2", 1, 1e5, "measuring range; the chip's next larger one is used",
       EPILINE_AT(devices.imu.accelerometer_range_m_s2)},
      {"imu.gyroscope_noise_density", "rad/s/sqrt(Hz)", 1e-9, 1, "density of the white noise",
       EPILINE_AT(estimator.imu.gyroscope_density)},
      {"imu.gyroscope_random_walk", "rad/s^2/sqrt(Hz)", 1e-12, 1, "random walk of the bias",
       EPILINE_AT(estimator.imu.gyroscope_random_walk)},
      {"imu.accelerometer_noise_density", "m/s^2/sqrt(Hz)", 1e-9, 10, "density of the white noise",
       EPILINE_AT(estimator.imu.accelerometer_density)},
      {"imu.accelerometer_random_walk", "m/s^3/sqrt(Hz)", 1e-12, 10, "random walk of the bias",
       EPILINE_AT(estimator.imu.accelerometer_random_walk)},
      {"imu.gyroscope_saturation", "rad/s", 0.1, kNoLimit, "limit of the sensor: larger values are clipped",
       EPILINE_AT(estimator.saturation_gyroscope_rad_s)},
      {"imu.accelerometer_saturation", "m/s^2", 1, kNoLimit, "limit of the sensor: larger values are clipped",
       EPILINE_AT(estimator.saturation_accelerometer_m_s2)},
      // how the IMU sits in the vehicle
      {"body.roll_deg", "deg", -180, 180,
       "third rotation, about x, from the vehicle's axes (forward, left, up) to the IMU's",
       EPILINE_AT(devices.body.roll_deg)},
      {"body.pitch_deg", "deg", -180, 180, "second rotation, about y", EPILINE_AT(devices.body.pitch_deg)},
      {"body.yaw_deg", "deg", -180, 180, "first rotation, about z", EPILINE_AT(devices.body.yaw_deg)},
      // a flight controller
      {"mavlink.serial", "", 0, 0, "serial port of the flight controller", EPILINE_AT(devices.mavlink.serial)},
      {"mavlink.baud", "", 1200, 4e6, "baud rate of the serial port", EPILINE_AT(devices.mavlink.baud)},
      {"mavlink.udp", "", 0, 0, "ADDRESS:PORT of the flight controller, instead of a serial line",
       EPILINE_AT(devices.mavlink.udp)},
      {"mavlink.udp_listen", "", 0, 0, "own ADDRESS:PORT to send from and receive on; default: any free port",
       EPILINE_AT(devices.mavlink.udp_listen)},
      {"mavlink.system", "", 1, 255, "MAVLink system id of the vehicle", EPILINE_AT(devices.mavlink.system)},
      {"mavlink.component", "", 1, 255, "MAVLink component id of epiline", EPILINE_AT(devices.mavlink.component)},
      {"mavlink.signing_key_file", "", 0, 0,
       "file with the key of MAVLink 2 signing, 32 bytes or 64 hexadecimal digits: frames are signed, unsigned ones "
       "ignored",
       EPILINE_AT(devices.mavlink.signing_key_file)},
      {"mavlink.rate_hz", "Hz", 4, 100, "odometry messages per second", EPILINE_AT(devices.mavlink.rate_hz)},
      {"mavlink.message", "", 0, 0, "message that carries the odometry",
       EPILINE_CHOICE(devices.mavlink.message, kMavlinkMessageNames)},
      {"mavlink.frame", "", 0, 0,
       "frame of the poses: local-frd begins with any heading, local-ned has x to the north and needs heading_deg",
       EPILINE_CHOICE(devices.mavlink.frame, kMavlinkFrameNames)},
      {"mavlink.heading_deg", "deg", -1, 360,
       "for local-ned: the vehicle's heading at the first pose, clockwise from true north; -1: not known",
       EPILINE_AT(devices.mavlink.heading_deg)},
      {"mavlink.origin_latitude_deg", "deg", -90, 90,
       "origin of the local frame, for an ArduPilot without GPS; latitude and longitude 0: not sent",
       EPILINE_AT(devices.mavlink.origin_latitude_deg)},
      {"mavlink.origin_longitude_deg", "deg", -180, 180, "the same", EPILINE_AT(devices.mavlink.origin_longitude_deg)},
      {"mavlink.origin_altitude_m", "m", -1000, 10'000, "the same, above sea level",
       EPILINE_AT(devices.mavlink.origin_altitude_m)},
      // a CAN bus
      {"can.interface", "", 0, 0, "network interface of the CAN bus for odometry", EPILINE_AT(devices.can.interface)},
      {"can.fd", "", 0, 0, "true: CAN FD frames; false: classic frames", EPILINE_AT(devices.can.fd)},
      {"can.base_id", "", 1, 0x7f0, "first of eleven consecutive identifiers", EPILINE_AT(devices.can.base_id)},
      {"can.rate_hz", "Hz", 1, 200, "odometry epochs per second", EPILINE_AT(devices.can.rate_hz)},
      {"can.isotp_send_id", "", 0, 0x7ff, "identifier for MAVLink frames by ISO-TP; 0: none",
       EPILINE_AT(devices.can.isotp_send_id)},
      {"can.isotp_receive_id", "", 0, 0x7ff, "identifier of the receiver's ISO-TP frames",
       EPILINE_AT(devices.can.isotp_receive_id)},
      // speed of a ground vehicle
      {"wheel.interface", "", 0, 0, "network interface of the CAN bus with the vehicle's speed",
       EPILINE_AT(devices.wheel.interface)},
      {"wheel.id", "", 0, 0x1fffffff, "identifier of the frame with the speed", EPILINE_AT(devices.wheel.id)},
      {"wheel.extended", "", 0, 0, "the identifier has 29 bits", EPILINE_AT(devices.wheel.extended)},
      {"wheel.start_bit", "", 0, 511, "first bit of the signal, counted as in a DBC file",
       EPILINE_AT(devices.wheel.start_bit)},
      {"wheel.length", "bit", 1, 64, "length of the signal", EPILINE_AT(devices.wheel.length)},
      {"wheel.big_endian", "", 0, 0, "big-endian signal (DBC: @0)", EPILINE_AT(devices.wheel.big_endian)},
      {"wheel.is_signed", "", 0, 0, "signed signal (DBC: -)", EPILINE_AT(devices.wheel.is_signed)},
      {"wheel.scale_m_s", "m/s", -1e6, 1e6, "speed per count of the signal", EPILINE_AT(devices.wheel.scale_m_s)},
      {"wheel.offset_m_s", "m/s", -1e6, 1e6, "speed at a count of 0", EPILINE_AT(devices.wheel.offset_m_s)},
      {"wheel.delay_ms", "ms", 0, 1000, "delay from the measurement of a speed to the arrival of its frame",
       EPILINE_AT(devices.wheel.delay_ms)},
      {"wheel.x_m", "m", -100, 100, "middle of the non-steering axle, relative to the IMU: forward",
       EPILINE_AT(devices.wheel.x_m)},
      {"wheel.y_m", "m", -100, 100, "the same: left", EPILINE_AT(devices.wheel.y_m)},
      {"wheel.z_m", "m", -100, 100, "the same: up", EPILINE_AT(devices.wheel.z_m)},
      {"wheel.use", "", 0, 0, "use the speed, if there is one", EPILINE_AT(estimator.wheel.use)},
      {"wheel.sigma_m_s", "m/s", 1e-4, 100, "standard deviation of the speed", EPILINE_AT(estimator.wheel.sigma_m_s)},
      {"wheel.cauchy", "", 0.1, 100, "scale of the Cauchy kernel against slip, in sigmas",
       EPILINE_AT(estimator.wheel.cauchy)},
      // height sensors
      {"height.source", "", 0, 0,
       "source of the heights in a live flight; mavlink: the flight controller; iio: a barometer with a driver in the "
       "kernel",
       EPILINE_CHOICE(devices.height.source, kHeightSourceNames)},
      {"height.device", "", 0, 0, "source iio: name or path of the barometer; default: the only one there is",
       EPILINE_AT(devices.height.device)},
      {"height.rate_hz", "Hz", 1, 200, "source iio: how often the barometer is asked",
       EPILINE_AT(devices.height.rate_hz)},
      {"height.air_deg", "deg C", -60, 60, "temperature of the air at the ground: 3 degrees are 1 % of a height",
       EPILINE_AT(devices.height.air_deg)},
      {"height.barometer", "", 0, 0, "use the barometer, if there is one", EPILINE_AT(estimator.heights[0].use)},
      {"height.barometer_sigma_m", "m", 1e-3, 100, "standard deviation of its heights: white noise",
       EPILINE_AT(estimator.heights[0].sigma_m)},
      {"height.barometer_walk", "m/sqrt(s)", 0, 10, "random walk of its offset, by weather and gusts",
       EPILINE_AT(estimator.heights[0].walk_per_root_s)},
      {"height.range", "", 0, 0, "use the range finder, if there is one", EPILINE_AT(estimator.heights[1].use)},
      {"height.range_sigma_m", "m", 1e-3, 100, "standard deviation of its distances: white noise",
       EPILINE_AT(estimator.heights[1].sigma_m)},
      {"height.range_ground_walk", "m/sqrt(m)", 0, 10, "random walk of the ground's height along the way",
       EPILINE_AT(estimator.heights[1].walk_per_root_m)},
      {"height.range_tracks", "", 0, 0, "compare the distances with the depth of tracks near the beam: gives the scale",
       EPILINE_AT(estimator.heights[1].with_tracks)},
      {"height.range_least_m", "m", 0, 1e4, "shortest distance that it measures",
       EPILINE_AT(estimator.heights[1].least_m)},
      {"height.range_most_m", "m", 0, 1e4, "longest distance that it measures",
       EPILINE_AT(estimator.heights[1].most_m)},
      {"height.range_x_m", "m", -100, 100, "the range finder, relative to the IMU: forward",
       EPILINE_AT(devices.height.range_x_m)},
      {"height.range_y_m", "m", -100, 100, "the same: left", EPILINE_AT(devices.height.range_y_m)},
      {"height.range_z_m", "m", -100, 100, "the same: up", EPILINE_AT(devices.height.range_z_m)},
      {"height.range_forward_deg", "deg", -30, 30, "tilt of its beam from straight down: towards the front",
       EPILINE_AT(devices.height.range_forward_deg)},
      {"height.range_left_deg", "deg", -30, 30, "the same: to the left", EPILINE_AT(devices.height.range_left_deg)},
  };
  return table;
}

#undef EPILINE_AT
#undef EPILINE_CHOICE

}  // namespace epiline
