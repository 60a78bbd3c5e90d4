#pragma once
// The MAVLink messages we speak. Page: docs/flight-controller.md.
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "drivers/links/mavlink/field.h"

namespace epiline::mavlink {

static_assert(std::endian::native == std::endian::little, "fields are copied as they stand");

struct Heartbeat {
  static constexpr std::uint32_t kId = 0;
  std::uint32_t custom_mode = 0;
  std::uint8_t type = 18;      ///< MAV_TYPE_ONBOARD_CONTROLLER
  std::uint8_t autopilot = 8;  ///< MAV_AUTOPILOT_INVALID: not a flight controller
  std::uint8_t base_mode = 0;
  std::uint8_t system_status = 0;  ///< MAV_STATE
  std::uint8_t mavlink_version = 3;
  using M = Heartbeat;
  using Fields =
      Members<&M::custom_mode, &M::type, &M::autopilot, &M::base_mode, &M::system_status, &M::mavlink_version>;
};

struct SystemTime {
  static constexpr std::uint32_t kId = 2;
  std::uint64_t time_unix_usec = 0;
  std::uint32_t time_boot_ms = 0;
  using M = SystemTime;
  using Fields = Members<&M::time_unix_usec, &M::time_boot_ms>;
};

/// Units are the sensor's own.
struct RawImu {
  static constexpr std::uint32_t kId = 27;
  std::uint64_t time_usec = 0;
  std::int16_t xacc = 0, yacc = 0, zacc = 0, xgyro = 0, ygyro = 0, zgyro = 0, xmag = 0, ymag = 0, zmag = 0;
  std::uint8_t id = 0;
  std::int16_t temperature = 0;  ///< 0.01 deg C
  using M = RawImu;
  using Fields = Members<&M::time_usec, &M::xacc, &M::yacc, &M::zacc, &M::xgyro, &M::ygyro, &M::zgyro, &M::xmag,
                         &M::ymag, &M::zmag>;
  using Extensions = Members<&M::id, &M::temperature>;
};

/// Of a barometer. The three messages differ in number and name.
template <std::uint32_t id>
struct PressureMessage {
  static constexpr std::uint32_t kId = id;
  std::uint32_t time_boot_ms = 0;
  float press_abs = 0, press_diff = 0;                       ///< hPa
  std::int16_t temperature = 0, temperature_press_diff = 0;  ///< 0.01 deg C, of the sensors
  using M = PressureMessage;
  using Fields = Members<&M::time_boot_ms, &M::press_abs, &M::press_diff, &M::temperature>;
  using Extensions = Members<&M::temperature_press_diff>;
};
using ScaledPressure = PressureMessage<29>;
using ScaledPressure2 = PressureMessage<137>;
using ScaledPressure3 = PressureMessage<143>;

/// Of a range finder.
struct DistanceSensor {
  static constexpr std::uint32_t kId = 132;
  std::uint32_t time_boot_ms = 0;
  std::uint16_t min_distance = 0, max_distance = 0, current_distance = 0;  ///< cm
  std::uint8_t type = 0, id = 0;
  std::uint8_t orientation = 0;  ///< MAV_SENSOR_ORIENTATION: 25 looks down
  std::uint8_t covariance = 0;   ///< cm^2; 255: unknown
  float horizontal_fov = 0, vertical_fov = 0;
  std::array<float, 4> quaternion{};
  std::uint8_t signal_quality = 0;  ///< 0 unknown, 1 no signal, 100 perfect
  using M = DistanceSensor;
  using Fields = Members<&M::time_boot_ms, &M::min_distance, &M::max_distance, &M::current_distance, &M::type, &M::id,
                         &M::orientation, &M::covariance>;
  using Extensions = Members<&M::horizontal_fov, &M::vertical_fov, &M::quaternion, &M::signal_quality>;
};

/// Heights, m. The first is that of the barometer alone, and is never set anew.
struct Altitude {
  static constexpr std::uint32_t kId = 141;
  std::uint64_t time_usec = 0;
  float altitude_monotonic = 0, altitude_amsl = 0, altitude_local = 0, altitude_relative = 0, altitude_terrain = 0,
        bottom_clearance = 0;
  using M = Altitude;
  using Fields = Members<&M::time_usec, &M::altitude_monotonic, &M::altitude_amsl, &M::altitude_local,
                         &M::altitude_relative, &M::altitude_terrain, &M::bottom_clearance>;
};

/// A command to a system. What the parameters hold depends on the command.
struct CommandLong {
  static constexpr std::uint32_t kId = 76;
  float param1 = 0, param2 = 0, param3 = 0, param4 = 0, param5 = 0, param6 = 0, param7 = 0;
  std::uint16_t command = 0;  ///< MAV_CMD
  std::uint8_t target_system = 0, target_component = 0;
  std::uint8_t confirmation = 0;  ///< 0 the first time, then how often it was sent before
  using M = CommandLong;
  using Fields = Members<&M::param1, &M::param2, &M::param3, &M::param4, &M::param5, &M::param6, &M::param7,
                         &M::command, &M::target_system, &M::target_component, &M::confirmation>;
};

/// The answer to a command.
struct CommandAck {
  static constexpr std::uint32_t kId = 77;
  std::uint16_t command = 0;  ///< MAV_CMD
  std::uint8_t result = 0;    ///< MAV_RESULT: 0 accepted, 1 refused for now, 2 denied, 3 unknown, 4 failed
  std::uint8_t progress = 0;
  std::int32_t result_param2 = 0;
  std::uint8_t target_system = 0, target_component = 0;  ///< who had sent the command; 0: not said
  using M = CommandAck;
  using Fields = Members<&M::command, &M::result>;
  using Extensions = Members<&M::progress, &M::result_param2, &M::target_system, &M::target_component>;
};

/// Where on earth the local frame begins. ArduPilot without a satellite receiver wants one.
struct SetGpsGlobalOrigin {
  static constexpr std::uint32_t kId = 48;
  std::int32_t latitude = 0, longitude = 0;  ///< 1e-7 degrees
  std::int32_t altitude = 0;                 ///< mm above sea level
  std::uint8_t target_system = 0;
  std::uint64_t time_usec = 0;
  using M = SetGpsGlobalOrigin;
  using Fields = Members<&M::latitude, &M::longitude, &M::altitude, &M::target_system>;
  using Extensions = Members<&M::time_usec>;
};

struct VisionPositionEstimate {
  static constexpr std::uint32_t kId = 102;
  std::uint64_t usec = 0;
  float x = 0, y = 0, z = 0;           ///< m
  float roll = 0, pitch = 0, yaw = 0;  ///< rad
  std::array<float, 21> covariance{};  ///< as Odometry::pose_covariance
  std::uint8_t reset_counter = 0;
  using M = VisionPositionEstimate;
  using Fields = Members<&M::usec, &M::x, &M::y, &M::z, &M::roll, &M::pitch, &M::yaw>;
  using Extensions = Members<&M::covariance, &M::reset_counter>;
};

/// SI units but for pressures (hPa), magnetic field (gauss) and temperature (deg C).
struct HighresImu {
  static constexpr std::uint32_t kId = 105;
  std::uint64_t time_usec = 0;
  float xacc = 0, yacc = 0, zacc = 0, xgyro = 0, ygyro = 0, zgyro = 0, xmag = 0, ymag = 0, zmag = 0;
  float abs_pressure = 0, diff_pressure = 0, pressure_alt = 0, temperature = 0;
  std::uint16_t fields_updated = 0;
  std::uint8_t id = 0;
  using M = HighresImu;
  using Fields =
      Members<&M::time_usec, &M::xacc, &M::yacc, &M::zacc, &M::xgyro, &M::ygyro, &M::zgyro, &M::xmag, &M::ymag,
              &M::zmag, &M::abs_pressure, &M::diff_pressure, &M::pressure_alt, &M::temperature, &M::fields_updated>;
  using Extensions = Members<&M::id>;
};

/// A question has tc1 = 0 and the asker's clock in ts1; the answer has the other's clock in tc1 and ts1 as it came. ns.
struct Timesync {
  static constexpr std::uint32_t kId = 111;
  std::int64_t tc1 = 0, ts1 = 0;
  std::uint8_t target_system = 0, target_component = 0;
  using M = Timesync;
  using Fields = Members<&M::tc1, &M::ts1>;
  using Extensions = Members<&M::target_system, &M::target_component>;
};

struct StatusText {
  static constexpr std::uint32_t kId = 253;
  std::uint8_t severity = 6;    ///< MAV_SEVERITY: 0 emergency to 7 debug
  std::array<char, 50> text{};  ///< ends with a zero unless full
  std::uint16_t id = 0;         ///< of a text in several pieces; 0: one piece
  std::uint8_t chunk_seq = 0;
  using M = StatusText;
  using Fields = Members<&M::severity, &M::text>;
  using Extensions = Members<&M::id, &M::chunk_seq>;
};

/// See drivers/links/mavlink/odometry.h for what we put into it.
struct Odometry {
  static constexpr std::uint32_t kId = 331;
  std::uint64_t time_usec = 0;
  float x = 0, y = 0, z = 0;                          ///< m, in frame_id
  std::array<float, 4> q{1, 0, 0, 0};                 ///< w x y z, child_frame_id to frame_id
  float vx = 0, vy = 0, vz = 0;                       ///< m/s, in child_frame_id
  float rollspeed = 0, pitchspeed = 0, yawspeed = 0;  ///< rad/s, in child_frame_id
  /// Upper triangles, row by row, of position and rotation about the axes of frame_id, and of velocity and rates.
  /// Unknown: the first is not a number.
  std::array<float, 21> pose_covariance{}, velocity_covariance{};
  std::uint8_t frame_id = 20;        ///< MAV_FRAME_LOCAL_FRD
  std::uint8_t child_frame_id = 12;  ///< MAV_FRAME_BODY_FRD
  std::uint8_t reset_counter = 0;
  std::uint8_t estimator_type = 3;  ///< MAV_ESTIMATOR_TYPE_VIO
  std::int8_t quality = 0;          ///< -1 failed, 0 unknown, 1 to 100
  using M = Odometry;
  using Fields =
      Members<&M::time_usec, &M::x, &M::y, &M::z, &M::q, &M::vx, &M::vy, &M::vz, &M::rollspeed, &M::pitchspeed,
              &M::yawspeed, &M::pose_covariance, &M::velocity_covariance, &M::frame_id, &M::child_frame_id>;
  using Extensions = Members<&M::reset_counter, &M::estimator_type, &M::quality>;
};

// ---- questions to a flight controller, and its answers: release, parameters, what its filter makes of the odometry
// ----

/// Ends with a zero unless full.
using ParameterId = std::array<char, 16>;

struct ParamRequestRead {
  static constexpr std::uint32_t kId = 20;
  std::int16_t param_index = -1;  ///< -1: by name
  std::uint8_t target_system = 0, target_component = 0;
  ParameterId param_id{};
  using M = ParamRequestRead;
  using Fields = Members<&M::param_index, &M::target_system, &M::target_component, &M::param_id>;
};

struct ParamValue {
  static constexpr std::uint32_t kId = 22;
  float param_value = 0;  ///< PX4 puts the bits of an integer here, ArduPilot its value
  std::uint16_t param_count = 0, param_index = 0;
  ParameterId param_id{};
  std::uint8_t param_type = 9;  ///< MAV_PARAM_TYPE: 6 32-bit integer, 9 float
  using M = ParamValue;
  using Fields = Members<&M::param_value, &M::param_count, &M::param_index, &M::param_id, &M::param_type>;
};

/// Where on earth the controller's local frame begins.
struct GpsGlobalOrigin {
  static constexpr std::uint32_t kId = 49;
  std::int32_t latitude = 0, longitude = 0;  ///< 1e-7 degrees
  std::int32_t altitude = 0;                 ///< mm above sea level
  std::uint64_t time_usec = 0;               ///< PX4: when it was set, since boot
  using M = GpsGlobalOrigin;
  using Fields = Members<&M::latitude, &M::longitude, &M::altitude>;
  using Extensions = Members<&M::time_usec>;
};

struct AutopilotVersion {
  static constexpr std::uint32_t kId = 148;
  std::uint64_t capabilities = 0, uid = 0;
  std::uint32_t flight_sw_version = 0;  ///< from the highest byte: major, minor, patch, kind of release
  std::uint32_t middleware_sw_version = 0, os_sw_version = 0, board_version = 0;
  std::uint16_t vendor_id = 0, product_id = 0;
  std::array<std::uint8_t, 8> flight_custom_version{}, middleware_custom_version{}, os_custom_version{};
  std::array<std::uint8_t, 18> uid2{};
  using M = AutopilotVersion;
  using Fields = Members<&M::capabilities, &M::uid, &M::flight_sw_version, &M::middleware_sw_version, &M::os_sw_version,
                         &M::board_version, &M::vendor_id, &M::product_id, &M::flight_custom_version,
                         &M::middleware_custom_version, &M::os_custom_version>;
  using Extensions = Members<&M::uid2>;
};

/// Of ArduPilot's filter.
struct EkfStatusReport {
  static constexpr std::uint32_t kId = 193;
  float velocity_variance = 0, pos_horiz_variance = 0, pos_vert_variance = 0, compass_variance = 0,
        terrain_alt_variance = 0;
  std::uint16_t flags = 0;  ///< EKF_STATUS_FLAGS
  float airspeed_variance = 0;
  using M = EkfStatusReport;
  using Fields = Members<&M::velocity_variance, &M::pos_horiz_variance, &M::pos_vert_variance, &M::compass_variance,
                         &M::terrain_alt_variance, &M::flags>;
  using Extensions = Members<&M::airspeed_variance>;
};

/// Of PX4's filter. A ratio is that of innovation to gate; not a number (or 0) where nothing is fused.
struct EstimatorStatus {
  static constexpr std::uint32_t kId = 230;
  std::uint64_t time_usec = 0;
  float vel_ratio = 0, pos_horiz_ratio = 0, pos_vert_ratio = 0;
  float mag_ratio = 0;  ///< of the heading, whatever it is taken from
  float hagl_ratio = 0, tas_ratio = 0;
  float pos_horiz_accuracy = 0, pos_vert_accuracy = 0;  ///< m
  std::uint16_t flags = 0;                              ///< ESTIMATOR_STATUS_FLAGS
  using M = EstimatorStatus;
  using Fields = Members<&M::time_usec, &M::vel_ratio, &M::pos_horiz_ratio, &M::pos_vert_ratio, &M::mag_ratio,
                         &M::hagl_ratio, &M::tas_ratio, &M::pos_horiz_accuracy, &M::pos_vert_accuracy, &M::flags>;
};

/// Of PX4's filter, from 1.18 on: which kinds of sensors it means to fuse, and which it fuses. MAVLink's definition is
/// one in development; its layout of early 2026 had ten kinds, and has another checksum.
struct EstimatorSensorFusionStatus {
  static constexpr std::uint32_t kId = 514;
  static constexpr std::size_t kVision = 2;  ///< ESTIMATOR_SENSOR_FUSION_SOURCE_EV
  std::array<float, 9> test_ratio{};
  std::array<std::uint8_t, 9> intended{}, active{};
  using M = EstimatorSensorFusionStatus;
  using Fields = Members<&M::test_ratio, &M::intended, &M::active>;
};

/// All that we speak.
inline constexpr std::array kMessages{
    published<Heartbeat>("HEARTBEAT", 9, 9, 50),
    published<SystemTime>("SYSTEM_TIME", 12, 12, 137),
    published<RawImu>("RAW_IMU", 29, 26, 144),
    published<ScaledPressure>("SCALED_PRESSURE", 16, 14, 115),
    published<ScaledPressure2>("SCALED_PRESSURE2", 16, 14, 195),
    published<ScaledPressure3>("SCALED_PRESSURE3", 16, 14, 131),
    published<DistanceSensor>("DISTANCE_SENSOR", 39, 14, 85),
    published<Altitude>("ALTITUDE", 32, 32, 47),
    published<SetGpsGlobalOrigin>("SET_GPS_GLOBAL_ORIGIN", 21, 13, 41),
    published<CommandLong>("COMMAND_LONG", 33, 33, 152),
    published<CommandAck>("COMMAND_ACK", 10, 3, 143),
    published<VisionPositionEstimate>("VISION_POSITION_ESTIMATE", 117, 32, 158),
    published<HighresImu>("HIGHRES_IMU", 63, 62, 93),
    published<Timesync>("TIMESYNC", 18, 16, 34),
    published<StatusText>("STATUSTEXT", 54, 51, 83),
    published<Odometry>("ODOMETRY", 233, 230, 91),
    published<ParamRequestRead>("PARAM_REQUEST_READ", 20, 20, 214),
    published<ParamValue>("PARAM_VALUE", 25, 25, 220),
    published<GpsGlobalOrigin>("GPS_GLOBAL_ORIGIN", 20, 12, 39),
    published<AutopilotVersion>("AUTOPILOT_VERSION", 78, 60, 178),
    published<EkfStatusReport>("EKF_STATUS_REPORT", 26, 22, 71),
    published<EstimatorStatus>("ESTIMATOR_STATUS", 42, 42, 163),
    published<EstimatorSensorFusionStatus>("ESTIMATOR_SENSOR_FUSION_STATUS", 54, 54, 197),
};

}  // namespace epiline::mavlink
