#pragma once
// The words for a wrong number, in events.txt and stats.json.

namespace epiline {

/// In the order of the estimator's enumerations Suspect and Severity. Programs read them: a word keeps its meaning.
inline constexpr const char* kSuspectNames[] = {"camera_rotation",     "camera_rotation_inverted",
                                                "camera_place",        "axes_mirrored",
                                                "time_offset",         "gyroscope_units",
                                                "rotation_scale",      "turns_unrelated",
                                                "accelerometer_units", "misfit",
                                                "imu_misfit",          "tracks_behind",
                                                "gyroscope_noise",     "accelerometer_noise",
                                                "focal_length",        "lens_shape",
                                                "accelerometer_scale", "gyroscope_scale",
                                                "wheel_scale",         "wheel_slip",
                                                "wheel_stuck",         "wheel_delay"};
inline constexpr const char* kSeverityNames[] = {"none", "corrected", "suspect", "gross"};

}  // namespace epiline
