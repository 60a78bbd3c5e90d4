#pragma once
// The MAVLink messages we speak: what they hold, and from that their length and the seed of their checksum. Page:
// docs/flight-controller.md.
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <tuple>

#include "drivers/links/mavlink/answer_messages.h"
#include "drivers/links/mavlink/field.h"

namespace epiline::mavlink {

static_assert(std::endian::native == std::endian::little, "fields are copied as they stand");

// Members stand in the order they travel in: larger ones first, then extensions. Each message is checked against the
// published length and checksum seed below; the seed is made of all names, types and their order.

struct Heartbeat {
  static constexpr std::uint32_t kId = 0;
  static constexpr std::string_view kName = "HEARTBEAT";
  std::uint32_t custom_mode = 0;
  std::uint8_t type = 18;      ///< MAV_TYPE_ONBOARD_CONTROLLER
  std::uint8_t autopilot = 8;  ///< MAV_AUTOPILOT_INVALID: not a flight controller
  std::uint8_t base_mode = 0;
  std::uint8_t system_status = 0;  ///< MAV_STATE
  std::uint8_t mavlink_version = 3;
  static constexpr auto fields() {
    using M = Heartbeat;
    return std::make_tuple(field("custom_mode", &M::custom_mode), field("type", &M::type),
                           field("autopilot", &M::autopilot), field("base_mode", &M::base_mode),
                           field("system_status", &M::system_status), field("mavlink_version", &M::mavlink_version));
  }
};

struct SystemTime {
  static constexpr std::uint32_t kId = 2;
  static constexpr std::string_view kName = "SYSTEM_TIME";
  std::uint64_t time_unix_usec = 0;
  std::uint32_t time_boot_ms = 0;
  static constexpr auto fields() {
    using M = SystemTime;
    return std::make_tuple(field("time_unix_usec", &M::time_unix_usec), field("time_boot_ms", &M::time_boot_ms));
  }
};

/// Units are the sensor's own.
struct RawImu {
  static constexpr std::uint32_t kId = 27;
  static constexpr std::string_view kName = "RAW_IMU";
  std::uint64_t time_usec = 0;
  std::int16_t xacc = 0, yacc = 0, zacc = 0, xgyro = 0, ygyro = 0, zgyro = 0, xmag = 0, ymag = 0, zmag = 0;
  std::uint8_t id = 0;
  std::int16_t temperature = 0;  ///< 0.01 deg C
  static constexpr auto fields() {
    using M = RawImu;
    return std::make_tuple(field("time_usec", &M::time_usec), field("xacc", &M::xacc), field("yacc", &M::yacc),
                           field("zacc", &M::zacc), field("xgyro", &M::xgyro), field("ygyro", &M::ygyro),
                           field("zgyro", &M::zgyro), field("xmag", &M::xmag), field("ymag", &M::ymag),
                           field("zmag", &M::zmag), extension("id", &M::id), extension("temperature", &M::temperature));
  }
};

/// Of a barometer. The three messages differ in number and name.
template <std::uint32_t id>
struct PressureMessage {
  static constexpr std::uint32_t kId = id;
  static constexpr std::string_view kName = id == 29    ? "SCALED_PRESSURE"
                                            : id == 137 ? "SCALED_PRESSURE2"
                                                        : "SCALED_PRESSURE3";
  std::uint32_t time_boot_ms = 0;
  float press_abs = 0, press_diff = 0;                       ///< hPa
  std::int16_t temperature = 0, temperature_press_diff = 0;  ///< 0.01 deg C, of the sensors
  static constexpr auto fields() {
    using M = PressureMessage;
    return std::make_tuple(field("time_boot_ms", &M::time_boot_ms), field("press_abs", &M::press_abs),
                           field("press_diff", &M::press_diff), field("temperature", &M::temperature),
                           extension("temperature_press_diff", &M::temperature_press_diff));
  }
};
using ScaledPressure = PressureMessage<29>;
using ScaledPressure2 = PressureMessage<137>;
using ScaledPressure3 = PressureMessage<143>;

/// Of a range finder.
struct DistanceSensor {
  static constexpr std::uint32_t kId = 132;
  static constexpr std::string_view kName = "DISTANCE_SENSOR";
  std::uint32_t time_boot_ms = 0;
  std::uint16_t min_distance = 0, max_distance = 0, current_distance = 0;  ///< cm
  std::uint8_t type = 0, id = 0;
  std::uint8_t orientation = 0;  ///< MAV_SENSOR_ORIENTATION: 25 looks down
  std::uint8_t covariance = 0;   ///< cm^2; 255: unknown
  float horizontal_fov = 0, vertical_fov = 0;
  std::array<float, 4> quaternion{};
  std::uint8_t signal_quality = 0;  ///< 0 unknown, 1 no signal, 100 perfect
  static constexpr auto fields() {
    using M = DistanceSensor;
    return std::make_tuple(field("time_boot_ms", &M::time_boot_ms), field("min_distance", &M::min_distance),
                           field("max_distance", &M::max_distance), field("current_distance", &M::current_distance),
                           field("type", &M::type), field("id", &M::id), field("orientation", &M::orientation),
                           field("covariance", &M::covariance), extension("horizontal_fov", &M::horizontal_fov),
                           extension("vertical_fov", &M::vertical_fov), extension("quaternion", &M::quaternion),
                           extension("signal_quality", &M::signal_quality));
  }
};

/// Heights, m. The first is that of the barometer alone, and is never set anew.
struct Altitude {
  static constexpr std::uint32_t kId = 141;
  static constexpr std::string_view kName = "ALTITUDE";
  std::uint64_t time_usec = 0;
  float altitude_monotonic = 0, altitude_amsl = 0, altitude_local = 0, altitude_relative = 0, altitude_terrain = 0,
        bottom_clearance = 0;
  static constexpr auto fields() {
    using M = Altitude;
    return std::make_tuple(field("time_usec", &M::time_usec), field("altitude_monotonic", &M::altitude_monotonic),
                           field("altitude_amsl", &M::altitude_amsl), field("altitude_local", &M::altitude_local),
                           field("altitude_relative", &M::altitude_relative),
                           field("altitude_terrain", &M::altitude_terrain),
                           field("bottom_clearance", &M::bottom_clearance));
  }
};

/// A command to a system. What the parameters hold depends on the command.
struct CommandLong {
  static constexpr std::uint32_t kId = 76;
  static constexpr std::string_view kName = "COMMAND_LONG";
  float param1 = 0, param2 = 0, param3 = 0, param4 = 0, param5 = 0, param6 = 0, param7 = 0;
  std::uint16_t command = 0;  ///< MAV_CMD
  std::uint8_t target_system = 0, target_component = 0;
  std::uint8_t confirmation = 0;  ///< 0 the first time, then how often it was sent before
  static constexpr auto fields() {
    using M = CommandLong;
    return std::make_tuple(field("param1", &M::param1), field("param2", &M::param2), field("param3", &M::param3),
                           field("param4", &M::param4), field("param5", &M::param5), field("param6", &M::param6),
                           field("param7", &M::param7), field("command", &M::command),
                           field("target_system", &M::target_system), field("target_component", &M::target_component),
                           field("confirmation", &M::confirmation));
  }
};

/// The answer to a command.
struct CommandAck {
  static constexpr std::uint32_t kId = 77;
  static constexpr std::string_view kName = "COMMAND_ACK";
  std::uint16_t command = 0;  ///< MAV_CMD
  std::uint8_t result = 0;    ///< MAV_RESULT: 0 accepted, 1 refused for now, 2 denied, 3 unknown, 4 failed
  std::uint8_t progress = 0;
  std::int32_t result_param2 = 0;
  std::uint8_t target_system = 0, target_component = 0;  ///< who had sent the command; 0: not said
  static constexpr auto fields() {
    using M = CommandAck;
    return std::make_tuple(field("command", &M::command), field("result", &M::result),
                           extension("progress", &M::progress), extension("result_param2", &M::result_param2),
                           extension("target_system", &M::target_system),
                           extension("target_component", &M::target_component));
  }
};

/// Where on earth the local frame begins. ArduPilot without a satellite receiver wants one.
struct SetGpsGlobalOrigin {
  static constexpr std::uint32_t kId = 48;
  static constexpr std::string_view kName = "SET_GPS_GLOBAL_ORIGIN";
  std::int32_t latitude = 0, longitude = 0;  ///< 1e-7 degrees
  std::int32_t altitude = 0;                 ///< mm above sea level
  std::uint8_t target_system = 0;
  std::uint64_t time_usec = 0;
  static constexpr auto fields() {
    using M = SetGpsGlobalOrigin;
    return std::make_tuple(field("latitude", &M::latitude), field("longitude", &M::longitude),
                           field("altitude", &M::altitude), field("target_system", &M::target_system),
                           extension("time_usec", &M::time_usec));
  }
};

struct VisionPositionEstimate {
  static constexpr std::uint32_t kId = 102;
  static constexpr std::string_view kName = "VISION_POSITION_ESTIMATE";
  std::uint64_t usec = 0;
  float x = 0, y = 0, z = 0;           ///< m
  float roll = 0, pitch = 0, yaw = 0;  ///< rad
  std::array<float, 21> covariance{};  ///< as Odometry::pose_covariance
  std::uint8_t reset_counter = 0;
  static constexpr auto fields() {
    using M = VisionPositionEstimate;
    return std::make_tuple(field("usec", &M::usec), field("x", &M::x), field("y", &M::y), field("z", &M::z),
                           field("roll", &M::roll), field("pitch", &M::pitch), field("yaw", &M::yaw),
                           extension("covariance", &M::covariance), extension("reset_counter", &M::reset_counter));
  }
};

/// SI units but for pressures (hPa), magnetic field (gauss) and temperature (deg C).
struct HighresImu {
  static constexpr std::uint32_t kId = 105;
  static constexpr std::string_view kName = "HIGHRES_IMU";
  std::uint64_t time_usec = 0;
  float xacc = 0, yacc = 0, zacc = 0, xgyro = 0, ygyro = 0, zgyro = 0, xmag = 0, ymag = 0, zmag = 0;
  float abs_pressure = 0, diff_pressure = 0, pressure_alt = 0, temperature = 0;
  std::uint16_t fields_updated = 0;
  std::uint8_t id = 0;
  static constexpr auto fields() {
    using M = HighresImu;
    return std::make_tuple(
        field("time_usec", &M::time_usec), field("xacc", &M::xacc), field("yacc", &M::yacc), field("zacc", &M::zacc),
        field("xgyro", &M::xgyro), field("ygyro", &M::ygyro), field("zgyro", &M::zgyro), field("xmag", &M::xmag),
        field("ymag", &M::ymag), field("zmag", &M::zmag), field("abs_pressure", &M::abs_pressure),
        field("diff_pressure", &M::diff_pressure), field("pressure_alt", &M::pressure_alt),
        field("temperature", &M::temperature), field("fields_updated", &M::fields_updated), extension("id", &M::id));
  }
};

/// A question has tc1 = 0 and the asker's clock in ts1; the answer has the other's clock in tc1 and ts1 as it came. ns.
struct Timesync {
  static constexpr std::uint32_t kId = 111;
  static constexpr std::string_view kName = "TIMESYNC";
  std::int64_t tc1 = 0, ts1 = 0;
  std::uint8_t target_system = 0, target_component = 0;
  static constexpr auto fields() {
    using M = Timesync;
    return std::make_tuple(field("tc1", &M::tc1), field("ts1", &M::ts1), extension("target_system", &M::target_system),
                           extension("target_component", &M::target_component));
  }
};

struct StatusText {
  static constexpr std::uint32_t kId = 253;
  static constexpr std::string_view kName = "STATUSTEXT";
  std::uint8_t severity = 6;    ///< MAV_SEVERITY: 0 emergency to 7 debug
  std::array<char, 50> text{};  ///< ends with a zero unless full
  std::uint16_t id = 0;         ///< of a text in several pieces; 0: one piece
  std::uint8_t chunk_seq = 0;
  static constexpr auto fields() {
    using M = StatusText;
    return std::make_tuple(field("severity", &M::severity), field("text", &M::text), extension("id", &M::id),
                           extension("chunk_seq", &M::chunk_seq));
  }
};

/// See drivers/links/mavlink/odometry.h for what we put into it.
struct Odometry {
  static constexpr std::uint32_t kId = 331;
  static constexpr std::string_view kName = "ODOMETRY";
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
  static constexpr auto fields() {
    using M = Odometry;
    return std::make_tuple(field("time_usec", &M::time_usec), field("x", &M::x), field("y", &M::y), field("z", &M::z),
                           field("q", &M::q), field("vx", &M::vx), field("vy", &M::vy), field("vz", &M::vz),
                           field("rollspeed", &M::rollspeed), field("pitchspeed", &M::pitchspeed),
                           field("yawspeed", &M::yawspeed), field("pose_covariance", &M::pose_covariance),
                           field("velocity_covariance", &M::velocity_covariance), field("frame_id", &M::frame_id),
                           field("child_frame_id", &M::child_frame_id), extension("reset_counter", &M::reset_counter),
                           extension("estimator_type", &M::estimator_type), extension("quality", &M::quality));
  }
};

/// The checksum of frames: CRC-16/MCRF4XX, begins with 0xffff.
constexpr std::uint16_t crc_add(std::uint16_t crc, std::uint8_t byte) {
  const auto low = static_cast<std::uint8_t>(byte ^ (crc & 0xff));
  const auto mixed = static_cast<std::uint8_t>(low ^ (low << 4));
  return static_cast<std::uint16_t>((crc >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4));
}
constexpr std::uint16_t crc_add(std::uint16_t crc, std::string_view text) {
  for (const char c : text) crc = crc_add(crc, static_cast<std::uint8_t>(c));
  return crc;
}

template <class T>
struct Element {
  using Type = T;
  static constexpr std::size_t kCount = 1;
  static constexpr bool kArray = false;
};
template <class T, std::size_t N>
struct Element<std::array<T, N>> {
  using Type = T;
  static constexpr std::size_t kCount = N;
  static constexpr bool kArray = true;
};

/// As the definitions of messages write it.
template <class T>
constexpr std::string_view type_name() {
  if constexpr (std::same_as<T, char>) return "char";
  if constexpr (std::same_as<T, float>) return "float";
  if constexpr (std::same_as<T, std::uint8_t>) return "uint8_t";
  if constexpr (std::same_as<T, std::int8_t>) return "int8_t";
  if constexpr (std::same_as<T, std::uint16_t>) return "uint16_t";
  if constexpr (std::same_as<T, std::int16_t>) return "int16_t";
  if constexpr (std::same_as<T, std::uint32_t>) return "uint32_t";
  if constexpr (std::same_as<T, std::int32_t>) return "int32_t";
  if constexpr (std::same_as<T, std::uint64_t>) return "uint64_t";
  if constexpr (std::same_as<T, std::int64_t>) return "int64_t";
}

/// visit(field) for each, in the order they travel in.
template <class Message, class Visit>
constexpr void for_each_field(Visit&& visit) {
  std::apply([&](const auto&... f) { (visit(f), ...); }, Message::fields());
}

/// Bytes of the payload, with extensions or without.
template <class Message>
constexpr std::size_t length_of(bool extensions = true) {
  std::size_t bytes = 0;
  for_each_field<Message>([&]<class M, class T>(const Field<M, T>& f) {
    if (extensions || !f.extension) bytes += sizeof(T);
  });
  return bytes;
}

template <class Message>
constexpr std::uint8_t crc_extra() {
  std::uint16_t crc = crc_add(crc_add(0xffff, Message::kName), " ");
  for_each_field<Message>([&]<class M, class T>(const Field<M, T>& f) {
    using E = Element<T>;
    if (f.extension) return;
    crc = crc_add(crc_add(crc, type_name<typename E::Type>()), " ");
    crc = crc_add(crc_add(crc, f.name), " ");
    if (E::kArray) crc = crc_add(crc, static_cast<std::uint8_t>(E::kCount));
  });
  return static_cast<std::uint8_t>((crc & 0xff) ^ (crc >> 8));
}

/// Larger elements first, extensions last.
template <class Message>
constexpr bool is_in_order() {
  std::size_t before = 8;
  bool extensions = false, good = true;
  for_each_field<Message>([&]<class M, class T>(const Field<M, T>& f) {
    const std::size_t size = sizeof(typename Element<T>::Type);
    good = good && (f.extension || (!extensions && size <= before));
    extensions = f.extension;
    before = size;
  });
  return good;
}

template <class Message>
constexpr bool is_published(std::size_t length, std::size_t base_length, std::uint8_t extra) {
  return is_in_order<Message>() && length_of<Message>() == length && length_of<Message>(false) == base_length &&
         crc_extra<Message>() == extra;
}
static_assert(is_published<Heartbeat>(9, 9, 50));
static_assert(is_published<SystemTime>(12, 12, 137));
static_assert(is_published<RawImu>(29, 26, 144));
static_assert(is_published<ScaledPressure>(16, 14, 115));
static_assert(is_published<ScaledPressure2>(16, 14, 195));
static_assert(is_published<ScaledPressure3>(16, 14, 131));
static_assert(is_published<DistanceSensor>(39, 14, 85));
static_assert(is_published<Altitude>(32, 32, 47));
static_assert(is_published<SetGpsGlobalOrigin>(21, 13, 41));
static_assert(is_published<CommandLong>(33, 33, 152));
static_assert(is_published<CommandAck>(10, 3, 143));
static_assert(is_published<VisionPositionEstimate>(117, 32, 158));
static_assert(is_published<HighresImu>(63, 62, 93));
static_assert(is_published<Timesync>(18, 16, 34));
static_assert(is_published<StatusText>(54, 51, 83));
static_assert(is_published<Odometry>(233, 230, 91));
static_assert(is_published<ParamRequestRead>(20, 20, 214));
static_assert(is_published<ParamValue>(25, 25, 220));
static_assert(is_published<GpsGlobalOrigin>(20, 12, 39));
static_assert(is_published<AutopilotVersion>(78, 60, 178));
static_assert(is_published<EkfStatusReport>(26, 22, 71));
static_assert(is_published<EstimatorStatus>(42, 42, 163));
static_assert(is_published<EstimatorSensorFusionStatus>(54, 54, 197));

/// What is needed to take a message apart without knowing its members.
struct MessageInfo {
  std::uint32_t id;
  std::uint8_t length, base_length, crc_extra;
};
template <class... Message>
constexpr auto table_of() {
  return std::array{MessageInfo{Message::kId, static_cast<std::uint8_t>(length_of<Message>()),
                                static_cast<std::uint8_t>(length_of<Message>(false)), crc_extra<Message>()}...};
}
inline constexpr auto kMessages =
    table_of<Heartbeat, SystemTime, RawImu, ScaledPressure, ScaledPressure2, ScaledPressure3, DistanceSensor, Altitude,
             SetGpsGlobalOrigin, CommandLong, CommandAck, VisionPositionEstimate, HighresImu, Timesync, StatusText,
             Odometry, ParamRequestRead, ParamValue, GpsGlobalOrigin, AutopilotVersion, EkfStatusReport,
             EstimatorStatus, EstimatorSensorFusionStatus>();

}  // namespace epiline::mavlink
