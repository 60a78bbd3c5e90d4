#pragma once
// Where a factor adds its information about the unknowns. The solver and the marginaliser keep H and b in different
// orders; a factor names the unknowns and adds its blocks without knowing either order.

namespace epiline {

/// One block of the window's unknowns: a pose (6), velocity and biases (9) of frame k, the calibration of the camera
/// (8) and, right after it, the scales of the IMU (2). A block that begins at the camera may hold both.
struct Unknown {
  enum class Kind : unsigned char { kPose, kVelocityBiases, kCamera, kScales };
  Kind kind;
  int frame;
};
constexpr Unknown pose_of(int k) { return {Unknown::Kind::kPose, k}; }
constexpr Unknown velocity_biases_of(int k) { return {Unknown::Kind::kVelocityBiases, k}; }
constexpr Unknown calibration_of_camera() { return {Unknown::Kind::kCamera, 0}; }
constexpr Unknown imu_scales() { return {Unknown::Kind::kScales, 0}; }

/// H delta = b. Only the upper triangle of H in its own order counts; the lower half of a diagonal block is ignored.
class NormalEquations {
 public:
  /// A block inside H: element (i, j) at `at[i * row + j * column]`. One of the two strides is 1.
  struct Block {
    double* at;
    int row, column;
  };
  virtual ~NormalEquations() = default;
  /// The block of rows `a` and columns `b`, or the transpose of the one kept.
  virtual Block block(Unknown a, Unknown b) noexcept = 0;
  virtual double* rhs(Unknown a) noexcept = 0;

  template <class Matrix>
  void add(Unknown a, Unknown b, const Matrix& H) noexcept {
    const Block to = block(a, b);
    if (to.column == 1)
      for (int i = 0; i < H.rows(); ++i)
        for (int j = 0; j < H.cols(); ++j) to.at[i * to.row + j] += H(i, j);
    else
      for (int j = 0; j < H.cols(); ++j)
        for (int i = 0; i < H.rows(); ++i) to.at[i + j * to.column] += H(i, j);
  }
  template <class Vector>
  void add(Unknown a, const Vector& b) noexcept {
    double* to = rhs(a);
    for (int i = 0; i < b.size(); ++i) to[i] += b[i];
  }
};

/// Which factors: those among the first `frames` frames of the window, or only those of them that contain frame 0.
struct Share {
  int frames;
  bool oldest_only;
};

}  // namespace epiline
