#include "pipeline/config/config.h"

#include <iterator>

namespace epiline {

#define AT(member) [](Config& c) { return &c.member; }
#define CHOICE(member, choices)                                                         \
  Choice {                                                                              \
    {std::begin(choices), std::end(choices)}, [](const Config& c) { return c.member; }, \
        [](Config& c, int i) { c.member = i; }                                          \
  }

// A live camera beside the first one; what is not here is as in [camera].
// clang-format off
#define OTHER_CAMERA(nth, in_chain, i)                                                                                \
  {nth "_camera.device", "path, name or bus of a " nth " camera beside the first one; default: none; "               \
   "[third_camera] and [fourth_camera] have the same settings", AT(devices.other_cameras[i].device)},                 \
  {nth "_camera.sensor", "part of the sensor's name in the media graph", AT(devices.other_cameras[i].sensor)},        \
  {nth "_camera.stamp_line", "GPIO line with an edge at the start of each of its exposures",                          \
   AT(devices.other_cameras[i].stamp_line)},                                                                          \
  {nth "_camera.calibration",                                                                                         \
   "its calibration file (ASL or Kalibr, there as " in_chain "); default: " in_chain " of camera.calibration",        \
   AT(devices.other_cameras[i].calibration)},                                                                         \
  {nth "_camera.mask", "picture of its size, as camera.mask", AT(masks[(i) + 1]), "", 0, 0, true},                    \
  {nth "_camera.free_running", "it is not triggered together with the first one: each of its images has its own time", \
   AT(devices.other_cameras[i].free_running)},                                                                        \
  {nth "_camera.within_ms",                                                                                           \
   "images of both cameras are taken together if their times differ by no more; 0: by 1 ms; free-running: by half "   \
   "a period of camera.rate_hz", AT(devices.other_cameras[i].within_ms), "ms", 0, 100}
// clang-format on

const std::vector<Parameter>& parameters() {
  static const std::vector<Parameter> table = {
      // estimator
      {"estimator.keyframes", "number of older images in the window", AT(estimator.keyframes), "", 2, 20},
      {"estimator.solve_interval_s", "solve at most one image per interval; the IMU predicts the others",
       AT(estimator.solve_interval_s), "s", 0, 0.4},
      {"estimator.pixel_sigma", "noise of a track in one image, before the estimator has learned it",
       AT(estimator.pixel_sigma), "px", 0.01, 10},
      {"estimator.zero_motion", "use standstill as a measurement", AT(estimator.zero_motion)},
      {"estimator.estimate_time_offset", "estimate the time offset t_IMU - t_image",
       AT(estimator.estimate_time_offset)},
      {"estimator.time_offset_sigma_s", "standard deviation of the initial time offset",
       AT(estimator.time_offset_sigma_s), "s", 1e-6, 1},
      {"estimator.estimate_extrinsics", "estimate the pose of the camera on the IMU",
       AT(estimator.estimate_extrinsics)},
      {"estimator.extrinsic_rotation_sigma_rad", "standard deviation of the calibrated rotation",
       AT(estimator.extrinsic_rotation_sigma_rad), "rad", 1e-6, 1},
      {"estimator.extrinsic_translation_sigma_m", "standard deviation of the calibrated translation",
       AT(estimator.extrinsic_translation_sigma_m), "m", 1e-6, 1},
      {"estimator.estimate_focal_length", "estimate focal length and shape of the lens",
       AT(estimator.estimate_focal_length)},
      {"estimator.focal_length_sigma", "relative standard deviation of the calibrated focal length and shape",
       AT(estimator.focal_length_sigma), "", 1e-6, 1},
      {"estimator.estimate_imu_scale", "estimate the scales of accelerometer and gyroscope",
       AT(estimator.estimate_imu_scale)},
      {"estimator.accelerometer_scale_sigma", "relative standard deviation of the accelerometer's scale",
       AT(estimator.accelerometer_scale_sigma), "", 1e-6, 1},
      {"estimator.gyroscope_scale_sigma", "relative standard deviation of the gyroscope's scale",
       AT(estimator.gyroscope_scale_sigma), "", 1e-6, 1},
      {"estimator.deadline_ms", "longest time for the solve of one image; 0: no limit", AT(deadline_ms), "ms", 0, 1e4},
      // tracker
      {"tracker.max_features", "number of tracks to maintain", AT(tracker.max_features), "", 1, 400},
      {"tracker.second_features",
       "tracks of a second camera alone; where the first one loses half of its own, as many as it lacks; 0: none, ever",
       AT(tracker.second_features), "", 0, 400},
      // threads of a real-time run
      {"realtime.deadline_ms", "longest time from an image's timestamp to its odometry; 0: no limit",
       AT(realtime.deadline_ms), "ms", 0, 1e4},
      {"realtime.imu_wait_ms", "longest time that an image waits for its IMU samples", AT(realtime.imu_wait_ms), "ms",
       1, 1e4},
      {"realtime.lock_memory", "lock the memory of the process", AT(realtime.lock_memory)},
      {"realtime.priority",
       "SCHED_FIFO priority of the IMU's thread; camera, output, tracker and estimator lie 10, 15, 20 and 20 below it; "
       "0: ordinary scheduling for all",
       AT(realtime.priority), "", 0, 99},
      {"realtime.cpus", "processors that threads are bound to; one without an entry runs on any",
       NamedValues{AT(realtime.cpus), {kFlightThreadNames.begin(), kFlightThreadNames.end()}}, "", 0, 1023},
      // flight recorder of a real-time run
      {"recorder.folder", "folder for records; without it there is no recorder", AT(recorder.folder)},
      {"recorder.seconds", "length of IMU samples, tracks, states and events to keep", AT(recorder.seconds), "s", 1,
       3600},
      {"recorder.images", "keep images as well", AT(recorder.images)},
      {"recorder.image_memory_mib", "memory for images; it may hold fewer seconds than the rest",
       AT(recorder.image_memory_mib), "MiB", 1, 65536},
      {"recorder.keep", "largest number of records in the folder: the oldest are removed; 0: no limit",
       AT(recorder.keep), "", 0, 1e6},
      // camera; without these, what the data set says
      {"camera.calibration",
       "calibration file (ASL or Kalibr), instead of the data set's; relative to the current folder",
       AT(camera_calibration)},
      {"camera.mask",
       "picture of the camera's size: black where it sees the vehicle itself; relative to the file that names it",
       AT(masks[0]), "", 0, 0, true},
      {"camera.device",
       "path, name or bus of the live camera, as v4l2-ctl --list-devices shows them, or its name in the media graph",
       AT(devices.camera.device)},
      {"camera.sensor", "part of the sensor's name in the media graph, if several lead to camera.device",
       AT(devices.camera.sensor)},
      {"camera.width", "of the grey image (of a colour mosaic half the camera's); 0: keep the device's setting",
       AT(devices.camera.width), "px", 0, 16384},
      {"camera.height", "0: keep the device's setting", AT(devices.camera.height), "px", 0, 16384},
      {"camera.rate_hz", "0: keep the device's setting", AT(devices.camera.rate_hz), "Hz", 0, 1000},
      {"camera.format",
       "pixel format as v4l2-ctl shows it: GREY, NV12, YU12, YUYV, Y10, RGGB, pRAA, MJPG and others (docs/camera.md); "
       "default: the one that costs least",
       AT(devices.camera.format)},
      {"camera.controls", "controls to set, in this order; names as v4l2-ctl --list-ctrls shows them",
       NamedValues{AT(devices.camera.controls), {}}},
      {"camera.shutter", "type of the sensor's shutter", CHOICE(devices.camera.shutter, kShutterNames)},
      {"camera.readout_ms", "time from the arrival of the first row to that of the last", AT(devices.camera.readout_ms),
       "ms", 0, 1000},
      {"camera.exposure_ms", "exposure time, if no control gives it", AT(devices.camera.exposure_ms), "ms", 0, 1000},
      {"camera.exposure_control", "control with the exposure time", AT(devices.camera.exposure_control)},
      {"camera.exposure_unit_ms", "exposure time of a value of 1 in exposure_control",
       AT(devices.camera.exposure_unit_ms), "ms", 1e-6, 1000},
      {"camera.stamp_point", "what the driver's timestamps refer to; first-row: its arrival, as receivers of CSI stamp",
       CHOICE(devices.camera.stamp_point, kStampPointNames)},
      {"camera.trust_stamps", "accept timestamps as monotonic although the driver does not declare it",
       AT(devices.camera.trust_stamps)},
      {"camera.clock", "clock of the timestamps; device: the camera's own, from the metadata of USB cameras",
       CHOICE(devices.camera.clock, kCameraClockNames)},
      {"camera.clock_hz", "ticks per second of the camera's own clock; 0: as its USB descriptors tell",
       AT(devices.camera.clock_hz), "Hz", 0, 4e9},
      {"camera.silence_ms", "reopen the device after this time without an image; 0: never",
       AT(devices.camera.silence_ms), "ms", 0, 1e6},
      {"camera.stamp_line", "GPIO line with an edge at the start of each exposure: name or CHIP:OFFSET",
       AT(devices.camera.stamp_line)},
      {"camera.stamp_edge", "active edge of the line", CHOICE(devices.camera.stamp_edge, kEdgeNames)},
      {"camera.time_offset_s", "initial time offset t_IMU - t_image", AT(estimator.extrinsics.time_offset_s), "s", -1,
       1},
      {"camera.side_by_side",
       "each image holds those of two cameras side by side, as stereo boards give them: which half is the first camera",
       CHOICE(devices.camera.side_by_side, kSideBySideNames)},
      OTHER_CAMERA("second", "cam1", 0),
      OTHER_CAMERA("third", "cam2", 1),
      OTHER_CAMERA("fourth", "cam3", 2),
      // control of a live camera's exposure
      {"exposure.automatic", "control exposure and gain for tracking; needs camera.exposure_control in manual mode",
       AT(devices.camera.exposure.automatic)},
      {"exposure.longest_ms", "longest exposure time; gain provides the rest", AT(devices.camera.exposure.longest_ms),
       "ms", 0.02, 1000},
      {"exposure.blur_px", "largest motion blur by rotation; 0: no limit", AT(devices.camera.exposure.blur_px), "px", 0,
       100},
      {"exposure.gain_control", "control with the gain; without it only the exposure time changes",
       AT(devices.camera.exposure.gain_control)},
      {"exposure.gain_unit", "gain of a value of 1 in gain_control: a factor, or dB",
       AT(devices.camera.exposure.gain_unit), "", 1e-6, 1e6},
      {"exposure.gain_scale", "scale of gain_control", CHOICE(devices.camera.exposure.gain_scale, kGainScaleNames)},
      {"exposure.gain_most", "largest gain, as a factor", AT(devices.camera.exposure.gain_most), "", 1, 1e4},
      {"exposure.flicker_hz", "flicker of the lamps, 100 or 120: long exposures become whole periods; 0: none",
       AT(devices.camera.exposure.flicker_hz), "Hz", 0, 1000},
      // IMU; without these, what the data set says
      {"imu.calibration", "calibration file (ASL or Kalibr), instead of the data set's; relative to the current folder",
       AT(imu_calibration)},
      {"imu.driver", "source of the IMU samples", CHOICE(devices.imu.driver, kImuDriverNames)},
      {"imu.device", "iio: name or path; SPI: /dev/spidevB.C (bmi088: of its gyroscope)", AT(devices.imu.device)},
      {"imu.device_accel", "the accelerometer, if it is a device of its own", AT(devices.imu.device_accel)},
      {"imu.trigger", "iio: name of a trigger; default: the one that is set, else the device's own",
       AT(devices.imu.trigger)},
      {"imu.rate_hz", "samples per second", AT(devices.imu.rate_hz), "Hz", 1, 10000},
      {"imu.ready_line", "GPIO line with the data-ready edge: name or CHIP:OFFSET", AT(devices.imu.ready_line)},
      {"imu.ready_edge", "active edge of the line", CHOICE(devices.imu.ready_edge, kEdgeNames)},
      {"imu.delay_ms", "delay from sampling to the timestamp, by filters and transport", AT(devices.imu.delay_ms), "ms",
       0, 100},
      {"imu.spi_hz", "clock of the SPI bus; 0: the default of the chip", AT(devices.imu.spi_hz), "Hz", 0, 1e8},
      {"imu.gyroscope_range_deg_s", "measuring range; the chip's next larger one is used",
       AT(devices.imu.gyroscope_range_deg_s), "deg/s", 1, 1e5},
      {"imu.accelerometer_range_m_s2", "measuring range; the chip's next larger one is used",
       AT(devices.imu.accelerometer_range_m_s2), "m/s^2", 1, 1e5},
      {"imu.gyroscope_noise_density", "density of the white noise", AT(estimator.imu.gyroscope_density),
       "rad/s/sqrt(Hz)", 1e-9, 1},
      {"imu.gyroscope_random_walk", "random walk of the bias", AT(estimator.imu.gyroscope_random_walk),
       "rad/s^2/sqrt(Hz)", 1e-12, 1},
      {"imu.accelerometer_noise_density", "density of the white noise", AT(estimator.imu.accelerometer_density),
       "m/s^2/sqrt(Hz)", 1e-9, 10},
      {"imu.accelerometer_random_walk", "random walk of the bias", AT(estimator.imu.accelerometer_random_walk),
       "m/s^3/sqrt(Hz)", 1e-12, 10},
      // how the IMU sits in the vehicle
      {"body.yaw_pitch_roll_deg",
       "rotations from the vehicle's axes (forward, left, up) to the IMU's: first about z, then y, then x",
       Numbers{AT(devices.body.yaw_pitch_roll_deg[0]), {{-180, 180}, {-180, 180}, {-180, 180}}}, "deg"},
      // a flight controller
      {"mavlink.serial", "serial port of the flight controller", AT(devices.mavlink.serial)},
      {"mavlink.baud", "baud rate of the serial port", AT(devices.mavlink.baud), "", 1200, 4e6},
      {"mavlink.udp", "ADDRESS:PORT of the flight controller, instead of a serial line", AT(devices.mavlink.udp)},
      {"mavlink.udp_listen", "own ADDRESS:PORT to send from and receive on; default: any free port",
       AT(devices.mavlink.udp_listen)},
      {"mavlink.system", "MAVLink system id of the vehicle", AT(devices.mavlink.system), "", 1, 255},
      {"mavlink.component", "MAVLink component id of epiline", AT(devices.mavlink.component), "", 1, 255},
      {"mavlink.signing_key_file",
       "file with the key of MAVLink 2 signing, 32 bytes or 64 hexadecimal digits: frames are signed, unsigned ones "
       "ignored",
       AT(devices.mavlink.signing_key_file)},
      {"mavlink.rate_hz", "odometry messages per second", AT(devices.mavlink.rate_hz), "Hz", 4, 100},
      {"mavlink.message", "message that carries the odometry", CHOICE(devices.mavlink.message, kMavlinkMessageNames)},
      {"mavlink.frame",
       "frame of the poses: local-frd begins with any heading, local-ned has x to the north and needs heading_deg",
       CHOICE(devices.mavlink.frame, kMavlinkFrameNames)},
      {"mavlink.heading_deg",
       "for local-ned: the vehicle's heading at the first pose, clockwise from true north; -1: not known",
       AT(devices.mavlink.heading_deg), "deg", -1, 360},
      {"mavlink.origin",
       "latitude, longitude and altitude of the local frame's origin, for an ArduPilot without GPS; latitude and "
       "longitude 0: not sent",
       Numbers{AT(devices.mavlink.origin[0]), {{-90, 90}, {-180, 180}, {-1000, 10'000}}}, "deg, deg, m"},
      // a CAN bus
      {"can.interface", "network interface of the CAN bus for odometry", AT(devices.can.interface)},
      {"can.fd", "true: CAN FD frames; false: classic frames", AT(devices.can.fd)},
      {"can.base_id", "first of eleven consecutive identifiers", AT(devices.can.base_id), "", 1, 0x7f0},
      {"can.rate_hz", "odometry epochs per second", AT(devices.can.rate_hz), "Hz", 1, 200},
      // odometry for nodes of ROS 2
      {"dds.publish", "publish odometry, transform and diagnostics for ROS 2 (docs/library.md)",
       AT(devices.dds.publish)},
      // speed of a ground vehicle
      {"wheel.interface", "network interface of the CAN bus with the vehicle's speed", AT(devices.wheel.interface)},
      {"wheel.signal", "identifier of the frame, and the speed in it, in m/s", AT(devices.wheel.signal)},
      {"wheel.delay_ms", "delay from the measurement of a speed to the arrival of its frame",
       AT(devices.wheel.delay_ms), "ms", 0, 1000},
      {"wheel.position_m",
       "middle of the non-steering axle, relative to the IMU: forward, left, up in the vehicle's axes",
       Numbers{AT(devices.wheel.position_m[0]), {{-100, 100}, {-100, 100}, {-100, 100}}}, "m"},
      {"wheel.use", "use the speed, if there is one", AT(estimator.wheel.use)},
      {"wheel.sigma_m_s", "standard deviation of a speed's noise", AT(estimator.wheel.sigma_m_s), "m/s", 1e-4, 100},
      {"wheel.scale_sigma", "standard deviation of the scale of all speeds (radius of the wheels, slip)",
       AT(estimator.wheel.scale_sigma), "", 1e-4, 1},
      {"wheel.sideways_sigma_m_s",
       "standard deviation of the speed sideways and upwards, of a vehicle that cannot go there; 0: it may go there",
       AT(estimator.wheel.sideways_sigma_m_s), "m/s", 0, 100},
      // height sensors
      {"height.source",
       "source of the heights in a live flight; mavlink: the flight controller; iio: a barometer with a driver in the "
       "kernel",
       CHOICE(devices.height.source, kHeightSourceNames)},
      {"height.device", "source iio: name or path of the barometer; default: the only one there is",
       AT(devices.height.device)},
      {"height.air_deg", "temperature of the air at the ground: 3 degrees are 1 % of a height",
       AT(devices.height.air_deg), "deg C", -60, 60},
      {"height.barometer", "use the barometer, if there is one", AT(estimator.heights[0].use)},
      {"height.barometer_sigma_m", "standard deviation of its heights: white noise", AT(estimator.heights[0].sigma_m),
       "m", 1e-3, 100},
      {"height.barometer_walk", "random walk of its offset, by weather and gusts",
       AT(estimator.heights[0].walk_per_root_s), "m/sqrt(s)", 0, 10},
      {"height.range", "use the range finder, if there is one", AT(estimator.heights[1].use)},
      {"height.range_sigma_m", "standard deviation of its distances: white noise", AT(estimator.heights[1].sigma_m),
       "m", 1e-3, 100},
      {"height.range_ground_walk", "random walk of the ground's height along the way",
       AT(estimator.heights[1].walk_per_root_m), "m/sqrt(m)", 0, 10},
      {"height.range_limits_m", "shortest and longest distance that it measures",
       Numbers{AT(estimator.heights[1].limits_m[0]), {{0, 1e4}, {0, 1e4}}}, "m"},
      {"height.range_position_m", "the range finder, relative to the IMU: forward, left, up in the vehicle's axes",
       Numbers{AT(devices.height.range_position_m[0]), {{-100, 100}, {-100, 100}, {-100, 100}}}, "m"},
      {"height.range_tilt_deg", "tilt of its beam from straight down: towards the front, to the left",
       Numbers{AT(devices.height.range_tilt_deg[0]), {{-30, 30}, {-30, 30}}}, "deg"},
  };
  return table;
}

#undef AT
#undef CHOICE
#undef OTHER_CAMERA

}  // namespace epiline
