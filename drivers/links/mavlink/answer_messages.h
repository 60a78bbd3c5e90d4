#pragma once
// The MAVLink messages with which a flight controller is asked, and answers: its release, its parameters, and what its
// filter makes of the odometry. Laid out as in message.h, which checks them.
#include <array>
#include <cstdint>
#include <string_view>
#include <tuple>

#include "drivers/links/mavlink/field.h"

namespace epiline::mavlink {

/// Ends with a zero unless full.
using ParameterId = std::array<char, 16>;

struct ParamRequestRead {
  static constexpr std::uint32_t kId = 20;
  static constexpr std::string_view kName = "PARAM_REQUEST_READ";
  std::int16_t param_index = -1;  ///< -1: by name
  std::uint8_t target_system = 0, target_component = 0;
  ParameterId param_id{};
  static constexpr auto fields() {
    using M = ParamRequestRead;
    return std::make_tuple(field("param_index", &M::param_index), field("target_system", &M::target_system),
                           field("target_component", &M::target_component), field("param_id", &M::param_id));
  }
};

struct ParamValue {
  static constexpr std::uint32_t kId = 22;
  static constexpr std::string_view kName = "PARAM_VALUE";
  float param_value = 0;  ///< PX4 puts the bits of an integer here, ArduPilot its value
  std::uint16_t param_count = 0, param_index = 0;
  ParameterId param_id{};
  std::uint8_t param_type = 9;  ///< MAV_PARAM_TYPE: 6 32-bit integer, 9 float
  static constexpr auto fields() {
    using M = ParamValue;
    return std::make_tuple(field("param_value", &M::param_value), field("param_count", &M::param_count),
                           field("param_index", &M::param_index), field("param_id", &M::param_id),
                           field("param_type", &M::param_type));
  }
};

/// Where on earth the controller's local frame begins.
struct GpsGlobalOrigin {
  static constexpr std::uint32_t kId = 49;
  static constexpr std::string_view kName = "GPS_GLOBAL_ORIGIN";
  std::int32_t latitude = 0, longitude = 0;  ///< 1e-7 degrees
  std::int32_t altitude = 0;                 ///< mm above sea level
  std::uint64_t time_usec = 0;               ///< PX4: when it was set, since boot
  static constexpr auto fields() {
    using M = GpsGlobalOrigin;
    return std::make_tuple(field("latitude", &M::latitude), field("longitude", &M::longitude),
                           field("altitude", &M::altitude), extension("time_usec", &M::time_usec));
  }
};

struct AutopilotVersion {
  static constexpr std::uint32_t kId = 148;
  static constexpr std::string_view kName = "AUTOPILOT_VERSION";
  std::uint64_t capabilities = 0, uid = 0;
  std::uint32_t flight_sw_version = 0;  ///< from the highest byte: major, minor, patch, kind of release
  std::uint32_t middleware_sw_version = 0, os_sw_version = 0, board_version = 0;
  std::uint16_t vendor_id = 0, product_id = 0;
  std::array<std::uint8_t, 8> flight_custom_version{}, middleware_custom_version{}, os_custom_version{};
  std::array<std::uint8_t, 18> uid2{};
  static constexpr auto fields() {
    using M = AutopilotVersion;
    return std::make_tuple(field("capabilities", &M::capabilities), field("uid", &M::uid),
                           field("flight_sw_version", &M::flight_sw_version),
                           field("middleware_sw_version", &M::middleware_sw_version),
                           field("os_sw_version", &M::os_sw_version), field("board_version", &M::board_version),
                           field("vendor_id", &M::vendor_id), field("product_id", &M::product_id),
                           field("flight_custom_version", &M::flight_custom_version),
                           field("middleware_custom_version", &M::middleware_custom_version),
                           field("os_custom_version", &M::os_custom_version), extension("uid2", &M::uid2));
  }
};

/// Of ArduPilot's filter.
struct EkfStatusReport {
  static constexpr std::uint32_t kId = 193;
  static constexpr std::string_view kName = "EKF_STATUS_REPORT";
  float velocity_variance = 0, pos_horiz_variance = 0, pos_vert_variance = 0, compass_variance = 0,
        terrain_alt_variance = 0;
  std::uint16_t flags = 0;  ///< EKF_STATUS_FLAGS
  float airspeed_variance = 0;
  static constexpr auto fields() {
    using M = EkfStatusReport;
    return std::make_tuple(
        field("velocity_variance", &M::velocity_variance), field("pos_horiz_variance", &M::pos_horiz_variance),
        field("pos_vert_variance", &M::pos_vert_variance), field("compass_variance", &M::compass_variance),
        field("terrain_alt_variance", &M::terrain_alt_variance), field("flags", &M::flags),
        extension("airspeed_variance", &M::airspeed_variance));
  }
};

/// Of PX4's filter. A ratio is that of innovation to gate; not a number (or 0) where nothing is fused.
struct EstimatorStatus {
  static constexpr std::uint32_t kId = 230;
  static constexpr std::string_view kName = "ESTIMATOR_STATUS";
  std::uint64_t time_usec = 0;
  float vel_ratio = 0, pos_horiz_ratio = 0, pos_vert_ratio = 0;
  float mag_ratio = 0;  ///< of the heading, whatever it is taken from
  float hagl_ratio = 0, tas_ratio = 0;
  float pos_horiz_accuracy = 0, pos_vert_accuracy = 0;  ///< m
  std::uint16_t flags = 0;                              ///< ESTIMATOR_STATUS_FLAGS
  static constexpr auto fields() {
    using M = EstimatorStatus;
    return std::make_tuple(field("time_usec", &M::time_usec), field("vel_ratio", &M::vel_ratio),
                           field("pos_horiz_ratio", &M::pos_horiz_ratio), field("pos_vert_ratio", &M::pos_vert_ratio),
                           field("mag_ratio", &M::mag_ratio), field("hagl_ratio", &M::hagl_ratio),
                           field("tas_ratio", &M::tas_ratio), field("pos_horiz_accuracy", &M::pos_horiz_accuracy),
                           field("pos_vert_accuracy", &M::pos_vert_accuracy), field("flags", &M::flags));
  }
};

/// Of PX4's filter, from 1.18 on: which kinds of sensors it means to fuse, and which it fuses. MAVLink's definition is
/// one in development; its layout of early 2026 had ten kinds, and has another checksum.
struct EstimatorSensorFusionStatus {
  static constexpr std::uint32_t kId = 514;
  static constexpr std::string_view kName = "ESTIMATOR_SENSOR_FUSION_STATUS";
  static constexpr std::size_t kVision = 2;  ///< ESTIMATOR_SENSOR_FUSION_SOURCE_EV
  std::array<float, 9> test_ratio{};
  std::array<std::uint8_t, 9> intended{}, active{};
  static constexpr auto fields() {
    using M = EstimatorSensorFusionStatus;
    return std::make_tuple(field("test_ratio", &M::test_ratio), field("intended", &M::intended),
                           field("active", &M::active));
  }
};

}  // namespace epiline::mavlink
