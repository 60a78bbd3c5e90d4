#pragma once
// The tracks of a start, their points eliminated from the joint least squares eight tracks at a time. Derivation:
// docs/derivations/initialisation.md.
#include "estimator/initialise/start_kernels.h"
#include "estimator/initialise/start_path.h"

namespace epiline {

using StartCameras = std::array<StartCamera, kStartFrames>;
/// The cameras of a path.
void place_cameras(const StartProblem& problem, const StartPath& path, const StartState& state, StartCameras& camera);

/// Derivative of g_0 by its two turns.
using GravityTurns = Eigen::Matrix<double, 3, 2>;

struct StartNormal {
  StartMatrix H = StartMatrix::Zero();  ///< upper half
  StartVector b = StartVector::Zero();
  double cost = 0;
};

/// Mean over the frames of b' H^-1 b per degree of freedom: the squared distance in sigmas by which each pose, free by
/// itself, would leave the path.
double mean_score(const StartEquations& equations, int frames);
/// Adds the equations, the poses mapped to the start's unknowns.
void add(const StartEquations& equations, const StartCameras& camera, int frames, const GravityTurns& gravity,
         StartNormal& sum);

/// About 280 kB.
class PointElimination {
 public:
  /// The wide stages use a third of the tracks.
  enum class Share : unsigned char { kThird, kAll };

  explicit PointElimination(InstructionSet set) : kernels_(start_kernels(set)) {}
  /// Takes the first kStartTracks tracks of a problem, as far as they have two views.
  void collect(const StartProblem& problem);
  /// The next equations begin at the closed form.
  void forget_points();
  /// The normal equations of a share of the tracks, and their robust cost. Each point moves by a step from where it was
  /// accepted last.
  void eliminate(const StartCameras& camera, const GravityTurns& gravity, double sigma, double kernel, Share share,
                 StartEquations& out);
  /// The points of the last equations are the ones to go on from.
  void accept();
  /// Degrees of freedom that a share of the tracks leaves to the start.
  int freedom(Share share) const;
  /// Median length of the residuals of tracks of three views or more, relative to that of Gaussian noise of one sigma;
  /// `tracks`: how many.
  double typical_residual(const StartCameras& camera, double sigma, double kernel, int& tracks) const;
  /// Median over these tracks of the widest angle between two bearings, the cameras' rotation removed, rad.
  double parallax(const StartCameras& camera) const;
  /// The linear system of the velocity and gravity: StartKernels::see_linear() of all tracks.
  StartLinear linear(const StartCameras& camera, double least, double sigma, const double (*at)[3]) const;
  const StartKernels& kernels() const { return kernels_; }

 private:
  static constexpr int kThirds = ((kStartTracks + 2) / 3 + kBatchLanes - 1) / kBatchLanes;
  static constexpr int kBatches = kThirds + (2 * kStartTracks / 3 + kBatchLanes - 1) / kBatchLanes;

  void put(const StartTrack& track, int batch, int lane);
  int batches(Share share) const { return share == Share::kAll ? batches_ : thirds_; }
  int views(int batch, int lane) const;

  const StartKernels& kernels_;
  int frames_ = 0, thirds_ = 0, batches_ = 0;  ///< the batches of the third come first
  bool known_ = false;                         ///< points were accepted
  int accepted_ = 0;                           ///< which of the two sets of points
  std::array<StartBatch, kBatches> batch_;
  std::array<std::array<std::uint32_t, kBatchLanes>, kBatches> seen_;  ///< bit k: by frame k
  std::array<std::array<StartPoints, kBatches>, 2> point_;
  StartScratch scratch_;
};

}  // namespace epiline
