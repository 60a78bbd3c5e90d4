#pragma once
// Text of the files of an ASL folder, for simulated flights and for the flight recorder.
#include <string>

#include "pipeline/config/calibration.h"
#include "platform/samples/samples.h"

namespace epiline {

inline constexpr const char* kAslImuHeader = "#timestamp [ns],w_x [rad s^-1],w_y,w_z,a_x [m s^-2],a_y,a_z\n";
inline constexpr const char* kAslWheelHeader = "#timestamp [ns],forward speed [m s^-1]\n";
inline constexpr const char* kAslTracksHeader = "#timestamp [ns],track_id,u [px],v [px]\n";
inline constexpr const char* kAslImagesHeader = "#timestamp [ns],filename\n";
/// Where a recording keeps the samples of a height sensor.
struct AslHeightTable {
  HeightKind kind;
  const char *folder, *header;
};
inline constexpr AslHeightTable kAslHeightTables[] = {
    {HeightKind::kBarometer, "baro0", "#timestamp [ns],height [m]\n"},
    {HeightKind::kRangeFinder, "range0", "#timestamp [ns],distance [m]\n"}};

/// cam0/sensor.yaml. `comment`: where the flight comes from.
std::string asl_camera(const CameraCalibration& camera, double image_rate_hz, const std::string& comment);
/// imu0/sensor.yaml.
std::string asl_imu(const ImuCalibration& imu);

/// A row of imu0/data.csv. Numbers are written so that reading them gives the same bits.
void append_asl_imu(std::string& text, const ImuSample& sample);
/// A row of wheel0/data.csv, likewise.
void append_asl_wheel(std::string& text, const WheelSample& sample);
/// A row of baro0/data.csv or range0/data.csv, likewise.
void append_asl_height(std::string& text, const HeightSample& sample);
/// A row of cam0/data.csv.
void append_asl_image(std::string& text, HostStamp stamp, const std::string& file);

}  // namespace epiline
