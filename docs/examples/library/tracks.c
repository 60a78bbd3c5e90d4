/* Tracks in, odometry out, in C: reads a flight with recorded tracks (epiline-study simulate --tracks writes one) and prints
 * its poses as trajectory.tum has them. Replace the files by your IMU and your tracker. */
#include <epiline.h>
#include <inttypes.h>
#include <stdio.h>

static FILE* open_table(const char* folder, const char* name) {
  char path[1000];
  snprintf(path, sizeof path, "%s/mav0/%s", folder, name);
  FILE* file = fopen(path, "r");
  if (file != NULL) fscanf(file, "#%*[^\n]"); /* the names of the columns */
  return file;
}

/* Pushes the samples up to the image and one more. */
static void push_imu(epiline_estimator* e, FILE* imu, int64_t image_ns) {
  static int64_t ns = INT64_MIN;
  double w[3], f[3];
  while (ns < image_ns &&
         fscanf(imu, "%" SCNd64 ",%lf,%lf,%lf,%lf,%lf,%lf", &ns, &w[0], &w[1], &w[2], &f[0], &f[1], &f[2]) == 7)
    epiline_push_imu(e, ns, w, f);
}

static void print_poses(epiline_estimator* e) {
  while (epiline_step(e)) {
    const epiline_state* s = epiline_get_state(e);
    const double *p = s->position_m, *q = s->orientation;
    if (!s->has_pose) continue;
    printf("%" PRId64 ".%09" PRId64 " %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", s->image_ns / 1000000000,
           s->image_ns % 1000000000, p[0], p[1], p[2], q[1], q[2], q[3], q[0]);
  }
}

int main(int argc, char** argv) {
  char settings[2500], error[1000];
  if (argc != 2) return 2;
  snprintf(settings, sizeof settings,
           "[camera]\ncalibration = '%s/mav0/cam0/sensor.yaml'\n[imu]\ncalibration = '%s/mav0/imu0/sensor.yaml'\n",
           argv[1], argv[1]);
  epiline_estimator* e = epiline_create(settings, EPILINE_TRACKS, error, sizeof error);
  FILE *imu = open_table(argv[1], "imu0/data.csv"), *tracks = open_table(argv[1], "cam0/tracks.csv");
  if (e == NULL || imu == NULL || tracks == NULL) return fprintf(stderr, "%s\n", e == NULL ? error : "no flight"), 1;

  epiline_point points[400];
  size_t count = 0;
  int64_t image_ns = 0, ns;
  double u, v;
  for (uint32_t id; fscanf(tracks, "%" SCNd64 ",%" SCNu32 ",%lf,%lf", &ns, &id, &u, &v) == 4;) {
    if (count > 0 && ns != image_ns) {
      push_imu(e, imu, image_ns);
      if (epiline_push_tracks(e, image_ns, points, count) != 0) return fprintf(stderr, "%s\n", epiline_error(e)), 1;
      print_poses(e);
      count = 0;
    }
    image_ns = ns;
    points[count++] = (epiline_point){id, (float)u, (float)v};
  }
  push_imu(e, imu, image_ns);
  epiline_push_tracks(e, image_ns, points, count);
  epiline_end(e);
  print_poses(e);
  fprintf(stderr, "%s\n", epiline_explain(e));
  epiline_destroy(e);
}
