#pragma once
// Parameters of flight controllers that take our odometry, as docs/first-flight.md has them.
#include <map>
#include <string>

namespace epiline::mavlink {

using RightParameters = std::map<std::string, float>;

inline const RightParameters kPx4Right{{"EKF2_EN", 1},          {"EKF2_EV_CTRL", 15},      {"EKF2_EV_QMIN", 1},
                                       {"EKF2_EV_NOISE_MD", 0}, {"EKF2_EVA_NOISE", 0.05F}, {"EKF2_EV_DELAY", 0},
                                       {"EKF2_DELAY_MAX", 200}, {"EKF2_HGT_REF", 3},       {"EKF2_GPS_CTRL", 0},
                                       {"EKF2_MAG_TYPE", 5},    {"SYS_HAS_MAG", 0}};
inline const RightParameters kArduPilotRight{
    {"AHRS_EKF_TYPE", 3}, {"EK3_ENABLE", 1},     {"VISO_TYPE", 1},      {"VISO_ORIENT", 0},   {"VISO_SCALE", 1},
    {"VISO_QUAL_MIN", 1}, {"EK3_SRC1_POSXY", 6}, {"EK3_SRC1_VELXY", 6}, {"EK3_SRC1_POSZ", 6}, {"EK3_SRC1_VELZ", 6},
    {"EK3_SRC1_YAW", 6},  {"COMPASS_ENABLE", 0}, {"GPS1_TYPE", 0},      {"VISO_DELAY_MS", 10}};

}  // namespace epiline::mavlink
