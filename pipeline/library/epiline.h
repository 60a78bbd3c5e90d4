/* Visual-inertial odometry from C, and from every language that calls C: IMU samples and images, or tracks, go in;
 * pose, velocity, covariance and health come out. docs/library.md; link with -lepiline.
 *
 * Frames: W is the world, z up, its origin and heading those of the start; B is the IMU; C is the camera. Times are
 * nanoseconds of one clock. Units: m, s, rad. A handle belongs to one thread at a time. The interface is stable: what
 * is here stays as it is, and new functions are added with a new EPILINE_INTERFACE. */
#ifndef EPILINE_H
#define EPILINE_H
/* NOLINTBEGIN(modernize-*,readability-identifier-naming): C */
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

#define EPILINE_INTERFACE 1

typedef struct epiline_estimator epiline_estimator;

enum epiline_input { EPILINE_IMAGES, EPILINE_TRACKS };
enum epiline_height { EPILINE_BAROMETER, EPILINE_RANGE_FINDER };
enum epiline_health { EPILINE_INITIALISING, EPILINE_TRACKING, EPILINE_DEGRADED, EPILINE_LOST };

/* A point of a track in one image: raw pixel, the centre of the top left pixel is (0, 0). */
typedef struct epiline_point {
  uint32_t id;
  float u, v;
} epiline_point;

/* The estimate at an image. Without a pose the numbers from stamp_ns to covariance are those of the start. */
typedef struct epiline_state {
  int64_t image_ns;                 /* stamp of the image */
  int64_t stamp_ns;                 /* the same instant on the IMU's clock */
  double position_m[3];             /* of B in W */
  double orientation[4];            /* Hamilton quaternion w x y z: turns vectors from B to W */
  double velocity_m_s[3];           /* of B in W */
  double angular_velocity_rad_s[3]; /* in B, bias removed */
  double accelerometer_bias_m_s2[3];
  double gyroscope_bias_rad_s[3];
  double imu_scale[2];       /* accelerometer, gyroscope: true readings over measured ones, less 1 */
  double time_offset_s;      /* of the IMU's clock: t_IMU = t_image + time_offset */
  double covariance[16][16]; /* position (W), rotation (B, right), velocity, accelerometer, gyroscope, time offset */
  int32_t has_pose;          /* 0: not started */
  int32_t health;            /* enum epiline_health */
  int32_t quality;           /* 0 to 100; -1 when lost */
  uint32_t reasons;          /* bits: HealthReason in platform/samples/samples.h; epiline_explain() names them */
  uint32_t reset_counter;    /* after a reset the pose continues somewhere else */
  uint32_t tracks;           /* points in the image */
} epiline_state;

/* Version of the library, for instance "0.1.0". */
const char* epiline_version(void);

/* `settings`: the text of a configuration in TOML (`epiline config` lists them); [camera] calibration is required.
 * NULL: it failed, and `error` (of `error_size` bytes, may be NULL) says what was found and what was expected. */
epiline_estimator* epiline_create(const char* settings, enum epiline_input input, char* error, size_t error_size);
void epiline_destroy(epiline_estimator*);

/* Each sensor's samples in the order of time; pixels and points are copied. 0: taken. -1: see epiline_error(). */
int epiline_push_imu(epiline_estimator*, int64_t ns, const double angular_velocity_rad_s[3],
                     const double specific_force_m_s2[3]);
int epiline_push_image(epiline_estimator*, int64_t ns, const uint8_t* grey, int width, int height,
                       int stride); /* mid-exposure */
int epiline_push_tracks(epiline_estimator*, int64_t ns, const epiline_point* points, size_t count);
int epiline_push_wheel(epiline_estimator*, int64_t ns, double forward_speed_m_s);
int epiline_push_height(epiline_estimator*, int64_t ns, enum epiline_height kind, double metres);
/* No more samples come: the images that wait need no later IMU samples. */
void epiline_end(epiline_estimator*);

/* Estimates the oldest image that waits. 1: epiline_get_state() is that of this image. 0: no image waits, or IMU
 * samples up to it are missing. Call it after each push until it returns 0. */
int epiline_step(epiline_estimator*);

/* Valid until the next call of epiline_step(). */
const epiline_state* epiline_get_state(const epiline_estimator*);
/* Health in words: state, reasons, and what contradicts the configured numbers. Valid until the next call. */
const char* epiline_explain(epiline_estimator*);
/* Of the last call that failed. Valid until the next one that does. */
const char* epiline_error(const epiline_estimator*);

#ifdef __cplusplus
}
#endif
/* NOLINTEND(modernize-*,readability-identifier-naming) */
#endif
