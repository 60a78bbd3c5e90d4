/* What the Python module calls besides pipeline/library/epiline.h: recorded flights. Not a public interface: module and
 * library come from one version. */
#ifndef EPILINE_DESK_H
#define EPILINE_DESK_H
/* NOLINTBEGIN(modernize-*,readability-identifier-naming): C */
#include "pipeline/library/epiline.h"
#ifdef __cplusplus
extern "C" {
#endif

/* Poses over time, and what an estimator claims of their errors if they are its own. */
typedef struct epiline_desk_trajectory epiline_desk_trajectory;
/* A replayed flight. */
typedef struct epiline_desk_flight epiline_desk_flight;

/* Why the last call of this thread failed: those that return NULL, or -1. */
const char* epiline_desk_error(void);

/* As `epiline replay` without files. `sets`: SECTION.KEY=VALUE, `set_count` of them; `config`: a file, empty: none.
 * `duration_s` 0: to the end. */
epiline_desk_flight* epiline_desk_replay(const char* dataset, const char* camera, const char* config,
                                         const char* const* sets, size_t set_count, double start_s, double duration_s);
void epiline_desk_destroy_flight(epiline_desk_flight*);
/* One for each image that was estimated. */
const epiline_state* epiline_desk_states(const epiline_desk_flight*, size_t* count);
const char* epiline_desk_statistics(const epiline_desk_flight*); /* stats.json */
const char* epiline_desk_tum(const epiline_desk_flight*);        /* trajectory.tum */
const char* epiline_desk_notes(const epiline_desk_flight*);      /* for the user, one a line */
/* The estimate, and the ground truth (NULL: none), for the caller to destroy. */
epiline_desk_trajectory* epiline_desk_estimate(const epiline_desk_flight*);
epiline_desk_trajectory* epiline_desk_truth(const epiline_desk_flight*);

/* odometry.csv of a replay, a TUM trajectory, or an ASL ground truth. */
epiline_desk_trajectory* epiline_desk_read_trajectory(const char* path);
/* `count` poses: ns, p (x y z), q (w x y z). */
epiline_desk_trajectory* epiline_desk_make_trajectory(size_t count, const int64_t* ns, const double* p,
                                                      const double* q);
void epiline_desk_destroy_trajectory(epiline_desk_trajectory*);
size_t epiline_desk_poses(const epiline_desk_trajectory*);
void epiline_desk_copy_poses(const epiline_desk_trajectory*, int64_t* ns, double* p, double* q);
/* What `epiline evaluate --json` prints; valid until the next call with this estimate. */
const char* epiline_desk_evaluate(epiline_desk_trajectory* estimate, const epiline_desk_trajectory* reference,
                                  const char* align);

/* An image file as 8-bit grey. First call with `pixels` NULL: its size. -1: no such image. */
int epiline_desk_read_image(const char* path, uint8_t* pixels, int* width, int* height);

#ifdef __cplusplus
}
#endif
/* NOLINTEND(modernize-*,readability-identifier-naming) */
#endif
