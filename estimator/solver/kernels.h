#pragma once
// The arithmetic of the window solver: the track and the reprojection factor over SIMD lanes, the IMU normal equations
// and the elimination. Compiled once per instruction set from kernels.inc and chosen at run time; therefore nothing but
// plain data here, so that no inline function can be emitted with instructions the machine lacks. Derivations:
// docs/derivations/track.md, docs/derivations/reprojection.md, docs/derivations/solver.md.

namespace epiline {

inline constexpr int kMaxFrames = 21;   ///< keyframes (at most 20) and the newest frame
inline constexpr int kCalibration = 7;  ///< time offset, extrinsic rotation, extrinsic translation
inline constexpr int kBatchLanes = 8;   ///< tracks in a batch, whatever the vector width
inline constexpr int kMaxTracks = 1024;
inline constexpr int kMaxBatches = kMaxTracks / kBatchLanes;
inline constexpr int kPoseDim = 6 * kMaxFrames + kCalibration;
inline constexpr int kPoseStride = 136;  ///< kPoseDim rounded up to whole vectors
inline constexpr int kPriorDim = 6 * kMaxFrames + 9 + kCalibration;
inline constexpr int kMarginalDim = 15 + kPriorDim;
inline constexpr int kMarginalStride = 160;

/// Eight tracks as a structure of arrays. An absent view is all zeros and drops out of every sum by itself.
struct alignas(64) TrackBatch {
  static constexpr int kBearing = 0, kChart = 3, kNumbers = 9;
  double observation[kMaxFrames][kNumbers][kBatchLanes];  ///< f (C), d(whitened pixel)/df row-major
  double views[kBatchLanes];                              ///< how many; 0: an empty lane
  int first, last;                                        ///< frames spanned
};

/// Pose of a frame as the track factor needs it; positions relative to one common origin.
struct FrameGeometry {
  double R_WC[9];  ///< row-major
  double c[3];     ///< camera centre
  double p[3];     ///< IMU position at the linearisation point (first estimate if the frame is in the prior)
};

struct TrackSettings {
  double depth_damping;         ///< lambda, 1/(1/m)^2
  double kernel_c2;             ///< Cauchy scale squared, in units of the whitened residual
  double gate_chi2, gate_cost;  ///< a track is gated if chi2 > gate_chi2 (9 dof + 9) and cost > gate_cost (4 dof + 4)
  bool gate;
  int inner_steps;
};

/// Normal equations of the visual factors, H delta = b; rotations perturbed in the world frame.
struct VisualSystem {
  double H[kMaxFrames][kMaxFrames][36];  ///< blocks k <= l, row-major, (dp, dphi)
  double b[kMaxFrames][6];
  double H_ck[kMaxFrames][kCalibration * 6];  ///< calibration against frame k
  double H_cc[kCalibration * kCalibration];   ///< symmetric, full
  double b_c[kCalibration];
  double cost;  ///< sum of the robust costs
  int residuals, tracks, gated;
};

/// Work space of the track factor: Q_k = C W_k [-rho I, [l]x] for each view, and sums per lane.
struct alignas(64) TrackScratch {
  double Q[2][kMaxFrames][kMaxBatches][18][kBatchLanes];  ///< [1]: without the oldest view (marginalisation)
  double D[kMaxFrames][27][kBatchLanes];
  double chi2[kMaxBatches][kBatchLanes];      ///< per track, of the last evaluation
  double accepted[kMaxBatches][kBatchLanes];  ///< 1, or 0 for gated and empty lanes
};

/// Landmarks come in batches of one host each; every host may leave a batch that is not full.
inline constexpr int kLandmarkBatches = kMaxBatches + kMaxFrames;

/// Work space of the reprojection factor, and what its depths' own step needs.
struct alignas(64) LandmarkScratch {
  double q[kMaxFrames][kLandmarkBatches][6][kBatchLanes];  ///< H_rho,k over the root of H_rho,rho, host included
  double e[kMaxFrames][kLandmarkBatches][3][kBatchLanes];  ///< W_k d_k
  double D[kMaxFrames][27][kBatchLanes];
  double gradient[kLandmarkBatches][kBatchLanes];   ///< of the depth: the right-hand side of its own equation
  double curvature[kLandmarkBatches][kBatchLanes];  ///< H_rho,rho
};

/// The window's normal equations. Order of elimination: (v, b) newest to oldest, then poses newest first, then
/// calibration.
struct alignas(64) LinearSystem {
  double S[kPoseDim][kPoseStride];       ///< upper triangle, row-major
  double P[kMaxFrames][9][kPoseStride];  ///< (v, b)_k against poses and calibration
  double D[kMaxFrames][9][16];           ///< (v, b)_k, upper triangle
  double C[kMaxFrames][9][16];           ///< (v, b)_k against (v, b)_{k-1}
  double rhs_s[kPoseStride];
  double rhs_v[kMaxFrames][16];
  int frames;
  int pose_dim() const;
};

struct Kernels {
  const char* name;
  /// Linearises the track factors. `marginal`: the information view 0 adds given the others, and nothing else.
  void (*track)(const TrackBatch* batches, int count, const FrameGeometry* frames, int frame_count,
                const TrackSettings&, bool marginal, TrackScratch&, VisualSystem&);
  /// Linearises landmarks at the inverse distances `rho` along their hosts' bearings (each batch's `first` frame) and
  /// eliminates them. Rotations and positions are perturbed about the common origin: q(dp, dphi) = (dp + p x dphi,
  /// dphi). Curvatures of rho below `damping` are raised to it.
  void (*landmarks)(const TrackBatch* batches, const double (*rho)[kBatchLanes], int count, const FrameGeometry* frames,
                    int frame_count, double damping, LandmarkScratch&, VisualSystem&);
  /// The landmarks' part of a step: changes of rho for cameras moved by `motion` (dc, dphi) from where landmarks() saw
  /// them.
  void (*landmark_step)(const TrackBatch* batches, const double (*rho)[kBatchLanes], int count,
                        const FrameGeometry* frames, const double (*motion)[6], const LandmarkScratch&,
                        double (*change)[kBatchLanes]);
  /// A = (L J)'(L J), g = -(L J)' L r for a 15x30 IMU Jacobian (rows padded to 32) and lower L (rows of 16); returns |L
  /// r|^2.
  double (*imu)(const double (*L)[16], const double (*J)[32], const double* r, double (*A)[32], double* g);
  /// Factorises in place, diagonal times (1 + damping). False: not positive definite.
  bool (*factorise)(LinearSystem&, double damping);
  /// Solves for 16 right-hand sides at once with the factors; x_v[k][9][16], x_s[dim][16] hold them and then the
  /// solutions.
  void (*solve)(const LinearSystem&, double (*x_v)[9][16], double (*x_s)[16]);
  /// Schur complement of the leading `lead` of `total` unknowns; A upper row-major with rows of kMarginalStride.
  void (*eliminate)(double* A, double* b, int lead, int total);
};

/// The best set this processor can run.
const Kernels& kernels();
/// By name ("sse", "avx2", "avx512", "neon", "generic"); null where it was not built or cannot run here.
const Kernels* kernels_named(const char* name);

}  // namespace epiline
