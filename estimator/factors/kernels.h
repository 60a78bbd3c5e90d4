#pragma once
// The arithmetic of the factors that runs over SIMD lanes: compiled once per instruction set from track.inc, imu.inc
// and calibration.inc, and chosen at run time. This header contains plain data only, so that no inline function is
// compiled to instructions that the machine lacks. Derivations: docs/derivations/track.md, docs/derivations/imu.md,
// docs/derivations/several_cameras.md.
#include "estimator/simd/instruction_set.h"
#include "estimator/window/capacity.h"
#include "estimator/window/observation.h"

namespace epiline {

/// Tracks are batched by the two cameras that see them (SortedTracks), and of each such pair one batch may not be full.
inline constexpr int kCameraPairs = 7;
inline constexpr int kMaxBatches = kMaxTracks / kBatchLanes + kCameraPairs;
inline constexpr double kNearest = 0.05;  ///< least depth along a bearing, relative to the length of its direction

/// The views of a track have slots: frame k's of the camera whose track it is slot k, those of a second camera behind
/// the last frame, with at least one slot free between them. The poses of all cameras have slots likewise.
inline constexpr int kMaxSlots = 2 * kMaxFrames + 1, kMaxPoses = kMaxCameras * (kMaxFrames + 1);

/// Eight tracks as a structure of arrays. An absent view is all zeros and adds nothing to any sum.
struct alignas(64) TrackBatch {
  static constexpr int kBearing = 0, kChart = 3, kBend = 9, kRow = 10, kAge = 11, kNumbers = 12;
  float view[kMaxSlots][kNumbers][kBatchLanes];  ///< the numbers of its Observation
  double turn[kMaxSlots][2][kBatchLanes];        ///< of the chart's axes: cosine and sine, over sigma
  double link[kMaxSlots][kBatchLanes];  ///< of a drifting track: 1 / variance of the step from its previous view;
                                        ///< 0: no view; of a second camera's: given the first one's
  double shared[kBatchLanes];           ///< so much of the first camera's error the second one's has, too
  double views[kBatchLanes];            ///< how many; 0: an empty lane
  double point[4][kBatchLanes];         ///< the last point, P and w: its direction from c is P - w c
  double warm[kBatchLanes];             ///< 2: `point` is of this frame, 1: of an earlier one, 0: none
  int first, last;                      ///< frames spanned
  int second;                           ///< slot of the second camera's view of frame 0; 0: it saw none of the tracks
  int home;                             ///< slot of frame 0's pose of the camera whose tracks these are
  int second_pose;                      ///< as `home`, of the second camera, less `home`; 0 if `second` is
};

static_assert(__builtin_offsetof(Observation, age) == sizeof(float) * TrackBatch::kAge, "its numbers, in its order");

/// Pose of a camera in a frame as the track factor needs it; by slots. Positions relative to one common origin.
struct FrameGeometry {
  double R_WC[9];   ///< row-major
  double c[3];      ///< camera centre
  double v[3];      ///< its velocity; of views with times of their own only
  double grows[3];  ///< slope of v by the pace
  double p[3];      ///< IMU position
};

/// What moves all views of a window at once and is no pose, in columns of its own.
inline constexpr int kLens = 0;   ///< the lens: its focal length ...
inline constexpr int kShape = 1;  ///< ... and its shape
inline constexpr int kPace = 2;   ///< how much faster it goes than when the velocities were held
inline constexpr int kColumns = 3;
inline constexpr int kProducts = kColumns * (kColumns + 1) / 2;
/// Where the product of two columns stands, the later one first.
constexpr int product_of(int c, int d) { return c * (c + 1) / 2 + d; }
/// 1 - cos of 32 degrees: so far off the axis the shape's number is a share of the radius.
inline constexpr double kShapeAt = 0.15;

struct TrackSettings {
  double scene_rho;             ///< what other tracks tell of an inverse depth, 1/m ...
  double scene_information;     ///< ... and how surely, 1/(1/m)^2
  double kernel_c2;             ///< Cauchy scale squared, in units of the whitened residual
  double gate_chi2, gate_cost;  ///< a track is gated if chi2 > gate_chi2 (9 dof + 9) and cost > gate_cost (4 dof + 4)
  bool gate;
  int inner_steps;   ///< at most
  double converged;  ///< rad, and relative depth: the inner steps end when the points of all lanes would move by less
  bool drift;        ///< a track's error is a random walk; else its views err independently
  double student;    ///< degrees of freedom of a drifting track's weight ...
  double unit;       ///< ... and the unit of its chi2
  bool rows;         ///< each view has its own time: of its row, or of a second camera's image
  bool wants[kColumns];  ///< columns to fill
  double focal, shape;   ///< estimate of the lens, as in Calibration
};

/// Normal equations of the visual factors, H delta = b; rotations perturbed in the world frame.
struct VisualSystem {
  double H[kMaxFrames][kMaxFrames][36];  ///< blocks k <= l, row-major, (dp, dphi)
  double b[kMaxFrames][6];
  double H_ck[kMaxFrames][kCameraCalibration * 6];       ///< calibration against frame k
  double H_cc[kCameraCalibration * kCameraCalibration];  ///< symmetric, full
  double b_c[kCameraCalibration];
  double H_column[kColumns][kMaxFrames][6];  ///< columns against frame k, of factors that have them
  double H_columns[kProducts], b_column[kColumns];
  double cost;  ///< sum of the robust costs
  int residuals, tracks, gated;
};

/// The rows of this many batches wait for their products, which is what the innermost caches hold.
inline constexpr int kBatchesAtOnce = 6;

/// The columns' blocks with each frame, and their own H and b.
struct alignas(64) ColumnScratch {
  double with[kColumns][kMaxFrames][6][kBatchLanes];
  double H[kProducts][kBatchLanes], b[kColumns][kBatchLanes];
};

/// Rows G_k [-rho I, [l]x] of one camera's views.
struct alignas(64) ViewScratch {
  double rows[kMaxFrames][kBatchesAtOnce][12][kBatchLanes];
  /// Information of a view's rows with themselves and with those of the next frame, negative: the rest is subtracted.
  double weights[kMaxFrames][kBatchesAtOnce][2][kBatchLanes];
};

/// Work space of the track factor.
struct alignas(64) TrackScratch {
  double rows[kMaxFrames][kBatchesAtOnce][18][kBatchLanes];  ///< Q_k = C W_k [-rho I, [l]x]
  ViewScratch views[2];                                      ///< of the tracks' own camera, and of a second one
  double b[kMaxFrames][6][kBatchLanes];
  ColumnScratch columns;
};

/// Work space for the information that the oldest view adds.
struct alignas(64) NewsScratch {
  double rows[kMaxFrames][kBatchesAtOnce][12][kBatchLanes];
  double second_rows[kMaxFrames][kBatchesAtOnce][12][kBatchLanes];  ///< the same of a second camera's oldest view
  double b[kMaxFrames][6][kBatchLanes];
  ColumnScratch columns;
};

/// Per track of a batch, of the last evaluation.
struct alignas(64) TrackVerdicts {
  double chi2[kBatchLanes];
  double fits[kBatchLanes];          ///< 1, or 0 for empty lanes and what contradicts the motion: the gate's verdict
  double depth_sigmas[kBatchLanes];  ///< inverse depth as the views alone have it, over its standard deviation
};

/// Variances of the walks of a batch's tracks, in steps: `start` at age `since`, and `step` more with each image.
struct alignas(64) Walks {
  double start[kBatchLanes], since[kBatchLanes], step[kBatchLanes];
};

struct FactorKernels {
  /// Puts the views of the slots first..last into a batch, kNoView where there is none, of charts that are not turned.
  void (*put_views)(const Observation* const (*views)[kBatchLanes], int first, int last, double inverse_sigma,
                    TrackBatch&);
  /// Links the views of drifting tracks, and turns their tangent planes about the bearings until the axes agree from
  /// view to view. `walks`: of each camera's views. A camera's views of a track follow each other without a hole.
  void (*link_views)(const Walks* walks, const FrameGeometry* frames, double inverse_sigma, TrackBatch&);
  /// Linearises the track factors and leaves their points in the batches.
  void (*track)(TrackBatch* batches, int count, const FrameGeometry* frames, int frame_count, const TrackSettings&,
                TrackScratch&, TrackVerdicts*, VisualSystem&);
  /// The information that frame 0's views add to the other views of the first `frame_count` frames.
  void (*track_news)(TrackBatch* batches, int count, const FrameGeometry* frames, int frame_count, const TrackSettings&,
                     NewsScratch&, TrackVerdicts*, VisualSystem&);
  /// Their cost alone.
  double (*track_cost)(TrackBatch* batches, int count, const FrameGeometry* frames, int frame_count,
                       const TrackSettings&, TrackVerdicts*);
  /// A = (L J)'(L J), upper triangle, g = -(L J)' L r for a 15x32 IMU Jacobian and lower L (rows of 16); returns
  /// |L r|^2.
  double (*imu)(const double* L, const double* J, const double* r, double (*A)[32], double* g);
  /// H_ck, H_cc and b_c from the poses' H and b of the first `frame_count` frames. `motion`, on whole vectors: (dp,
  /// dphi) of a frame's body that moves its camera as each calibration parameter does.
  void (*calibration)(const double (*motion)[6][kBatchLanes], int frame_count, VisualSystem&);
};

/// The kernels of an instruction set that this machine has.
const FactorKernels& factor_kernels(InstructionSet set);

}  // namespace epiline
