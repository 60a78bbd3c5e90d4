#include "pipeline/config/config.h"

#include <algorithm>

namespace epiline {

namespace {

Choice visual_factors() {
  return {{kVisualFactorNames.begin(), kVisualFactorNames.end()},
          [](const Config& c) { return static_cast<int>(c.estimator.visual_factor); },
          [](Config& c, int i) { c.estimator.visual_factor = static_cast<VisualFactor>(i); }};
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
// clang-format off
#define EPILINE_OTHER_CAMERA(nth, in_chain, i)                                                                        \
  {nth "_camera.device", "", 0, 0, "path, name or bus of a " nth " camera beside the first one; default: none; "     \
   "[third_camera] and [fourth_camera] have the same settings", EPILINE_AT(devices.other_cameras[i].device)},         \
  {nth "_camera.sensor", "", 0, 0, "part of the sensor's name in the media graph",                                    \
   EPILINE_AT(devices.other_cameras[i].sensor)},                                                                      \
  {nth "_camera.stamp_line", "", 0, 0, "GPIO line with an edge at the start of each of its exposures",                \
   EPILINE_AT(devices.other_cameras[i].stamp_line)},                                                                  \
  {nth "_camera.calibration", "", 0, 0,                                                                               \
   "its calibration file (ASL or Kalibr, there as " in_chain "); default: " in_chain " of camera.calibration",        \
   EPILINE_AT(devices.other_cameras[i].calibration)},                                                                 \
  {nth "_camera.mask", "", 0, 0, "picture of its size, as camera.mask", EPILINE_AT(masks[(i) + 1]), true},             \
  {nth "_camera.free_running", "", 0, 0,                                                                              \
   "it is not triggered together with the first one: each of its images has its own time",                            \
   EPILINE_AT(devices.other_cameras[i].free_running)},                                                                \
  {nth "_camera.within_ms", "ms", 0, 100,                                                                             \
   "images of both cameras are taken together if their times differ by no more; 0: by 1 ms; free-running: by half "   \
   "a period of camera.rate_hz",                                                                                      \
   EPILINE_AT(devices.other_cameras[i].within_ms)}
// clang-format on

const std::vector<Parameter>& parameters() {
  static const std::vector<Parameter> table = {
      // estimator
      {"estimator.visual_factor", "", 0, 0, "visual factor: which residual a track becomes", visual_factors()},
      {"estimator.keyframes", "", 2, 20, "number of older images in the window", EPILINE_AT(estimator.keyframes)},
      {"estimator.solve_interval_s", "s", 0, 0.4, "solve at most one image per interval; the IMU predicts the others",
       EPILINE_AT(estimator.solve_interval_s)},
      {"estimator.pixel_sigma", "px", 0.01, 10, "noise of a track in one image, before the estimator has learned it",
       EPILINE_AT(estimator.pixel_sigma)},
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
      // threads of a real-time run
      {"realtime.deadline_ms", "ms", 0, 1e4, "longest time from an image's timestamp to its odometry; 0: no limit",
       EPILINE_AT(realtime.deadline_ms)},
      {"realtime.imu_wait_ms", "ms", 1, 1e4, "longest time that an image waits for its IMU samples",
       EPILINE_AT(realtime.imu_wait_ms)},
      {"realtime.lock_memory", "", 0, 0, "lock the memory of the process", EPILINE_AT(realtime.lock_memory)},
      {"realtime.priority", "", 0, 99,
       "SCHED_FIFO priority of the IMU's thread; camera, output, tracker and estimator lie 10, 15, 20 and 20 below it; "
       "0: ordinary scheduling for all",
       EPILINE_AT(realtime.priority)},
      {"realtime.cpus", "", 0, 1023, "processors that threads are bound to; one without an entry runs on any",
       NamedValues{EPILINE_AT(realtime.cpus), {kFlightThreadNames.begin(), kFlightThreadNames.end()}}},
      // flight recorder of a real-time run
      {"recorder.folder", "", 0, 0, "folder for records; without it there is no recorder", EPILINE_AT(recorder.folder)},
      {"recorder.seconds", "s", 1, 3600, "length of IMU samples, tracks, states and events to keep",
       EPILINE_AT(recorder.seconds)},
      {"recorder.images", "", 0, 0, "keep images as well", EPILINE_AT(recorder.images)},
      {"recorder.image_memory_mib", "MiB", 1, 65536, "memory for images; it may hold fewer seconds than the rest",
       EPILINE_AT(recorder.image_memory_mib)},
      {"recorder.keep", "", 0, 1e6, "largest number of records in the folder: the oldest are removed; 0: no limit",
       EPILINE_AT(recorder.keep)},
      // camera; without these, what the data set says
      {"camera.calibration", "", 0, 0,
       "calibration file (ASL or Kalibr), instead of the data set's; relative to the current folder",
       EPILINE_AT(camera_calibration)},
      {"camera.mask", "", 0, 0,
       "picture of the camera's size: black where it sees the vehicle itself; relative to the file that names it",
       EPILINE_AT(masks[0]), true},
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
      {"camera.controls", "", 0, 0, "controls to set, in this order; names as v4l2-ctl --list-ctrls shows them",
       NamedValues{EPILINE_AT(devices.camera.controls), {}}},
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
      {"exposure.longest_ms", "ms", 0.02, 1000, "longest exposure time; gain provides the rest",
       EPILINE_AT(devices.camera.exposure.longest_ms)},
      {"exposure.blur_px", "px", 0, 100, "largest motion blur by rotation; 0: no limit",
       EPILINE_AT(devices.camera.exposure.blur_px)},
      {"exposure.gain_control", "", 0, 0, "control with the gain; without it only the exposure time changes",
       EPILINE_AT(devices.camera.exposure.gain_control)},
      {"exposure.gain_unit", "", 1e-6, 1e6, "gain of a value of 1 in gain_control: a factor, or dB",
       EPILINE_AT(devices.camera.exposure.gain_unit)},
      {"exposure.gain_scale", "", 0, 0, "scale of gain_control",
       EPILINE_CHOICE(devices.camera.exposure.gain_scale, kGainScaleNames)},
      {"exposure.gain_most", "", 1, 1e4, "largest gain, as a factor", EPILINE_AT(devices.camera.exposure.gain_most)},
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
      // how the IMU sits in the vehicle
      {"body.yaw_pitch_roll_deg", "deg", 0, 0,
       "rotations from the vehicle's axes (forward, left, up) to the IMU's: first about z, then y, then x",
       Numbers{EPILINE_AT(devices.body.yaw_pitch_roll_deg[0]), {{-180, 180}, {-180, 180}, {-180, 180}}}},
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
      {"mavlink.origin", "deg, deg, m", 0, 0,
       "latitude, longitude and altitude of the local frame's origin, for an ArduPilot without GPS; latitude and "
       "longitude 0: not sent",
       Numbers{EPILINE_AT(devices.mavlink.origin[0]), {{-90, 90}, {-180, 180}, {-1000, 10'000}}}},
      // a CAN bus
      {"can.interface", "", 0, 0, "network interface of the CAN bus for odometry", EPILINE_AT(devices.can.interface)},
      {"can.fd", "", 0, 0, "true: CAN FD frames; false: classic frames", EPILINE_AT(devices.can.fd)},
      {"can.base_id", "", 1, 0x7f0, "first of eleven consecutive identifiers", EPILINE_AT(devices.can.base_id)},
      {"can.rate_hz", "Hz", 1, 200, "odometry epochs per second", EPILINE_AT(devices.can.rate_hz)},
      // odometry for nodes of ROS 2
      {"dds.publish", "", 0, 0, "publish odometry, transform and diagnostics for ROS 2 (docs/library.md)",
       EPILINE_AT(devices.dds.publish)},
      // speed of a ground vehicle
      {"wheel.interface", "", 0, 0, "network interface of the CAN bus with the vehicle's speed",
       EPILINE_AT(devices.wheel.interface)},
      {"wheel.signal", "", 0, 0, "identifier of the frame, and the speed in it, in m/s",
       EPILINE_AT(devices.wheel.signal)},
      {"wheel.delay_ms", "ms", 0, 1000, "delay from the measurement of a speed to the arrival of its frame",
       EPILINE_AT(devices.wheel.delay_ms)},
      {"wheel.position_m", "m", 0, 0,
       "middle of the non-steering axle, relative to the IMU: forward, left, up in the vehicle's axes",
       Numbers{EPILINE_AT(devices.wheel.position_m[0]), {{-100, 100}, {-100, 100}, {-100, 100}}}},
      {"wheel.use", "", 0, 0, "use the speed, if there is one", EPILINE_AT(estimator.wheel.use)},
      {"wheel.sigma_m_s", "m/s", 1e-4, 100, "standard deviation of a speed's noise",
       EPILINE_AT(estimator.wheel.sigma_m_s)},
      {"wheel.scale_sigma", "", 1e-4, 1, "standard deviation of the scale of all speeds (radius of the wheels, slip)",
       EPILINE_AT(estimator.wheel.scale_sigma)},
      {"wheel.sideways_sigma_m_s", "m/s", 0, 100,
       "standard deviation of the speed sideways and upwards, of a vehicle that cannot go there; 0: it may go there",
       EPILINE_AT(estimator.wheel.sideways_sigma_m_s)},
      // height sensors
      {"height.source", "", 0, 0,
       "source of the heights in a live flight; mavlink: the flight controller; iio: a barometer with a driver in the "
       "kernel",
       EPILINE_CHOICE(devices.height.source, kHeightSourceNames)},
      {"height.device", "", 0, 0, "source iio: name or path of the barometer; default: the only one there is",
       EPILINE_AT(devices.height.device)},
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
      {"height.range_limits_m", "m", 0, 0, "shortest and longest distance that it measures",
       Numbers{EPILINE_AT(estimator.heights[1].limits_m[0]), {{0, 1e4}, {0, 1e4}}}},
      {"height.range_position_m", "m", 0, 0,
       "the range finder, relative to the IMU: forward, left, up in the vehicle's axes",
       Numbers{EPILINE_AT(devices.height.range_position_m[0]), {{-100, 100}, {-100, 100}, {-100, 100}}}},
      {"height.range_tilt_deg", "deg", 0, 0, "tilt of its beam from straight down: towards the front, to the left",
       Numbers{EPILINE_AT(devices.height.range_tilt_deg[0]), {{-30, 30}, {-30, 30}}}},
  };
  return table;
}

#undef EPILINE_AT
#undef EPILINE_CHOICE

}  // namespace epiline
