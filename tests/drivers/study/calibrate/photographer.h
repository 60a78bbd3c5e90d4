#pragma once
// Pictures of a printed board, for cameras of every lens model.
#include <cmath>
#include <cstdint>
#include <vector>

#include "drivers/flights/recordings/grey_image.h"
#include "drivers/study/calibrate/board_drawing.h"
#include "estimator/geometry/camera.h"

namespace epiline {

/// A printed board, in tenths of a millimetre, and a camera that takes its picture with 2 x 2 rays per pixel.
class Photographer {
 public:
  Photographer(const Board& board, const std::vector<BlackBox>& boxes, const Camera& camera) : camera_(camera) {
    std::visit(
        [this](const auto& kind) {
          margin_ = kind.margin_m();
          columns_ = static_cast<int>((kind.width_m() + 2 * margin_) / kDot_m);
          rows_ = static_cast<int>((kind.height_m() + 2 * margin_) / kDot_m);
        },
        board);
    black_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0);
    for (const BlackBox& box : boxes)
      for (int y = dot(box.y); y < dot(box.y + box.height); ++y)
        for (int x = dot(box.x); x < dot(box.x + box.width); ++x) black_[index(x, y)] = 1;
    for (int y = 0; y < camera.height(); ++y) {
      for (int x = 0; x < camera.width(); ++x) {
        for (const double v : {-0.25, 0.25}) {
          for (const double u : {-0.25, 0.25}) {
            Vec3 f_C = Vec3::Zero();
            camera.unproject(Vec2(x + u, y + v), f_C);
            rays_.push_back(f_C);
          }
        }
      }
    }
  }

  GreyImage take(const Mat3& R_TC, const Vec3& p_TC) const {
    GreyImage image;
    image.resize(camera_.width(), camera_.height());
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      int white = 0;
      for (std::size_t k = 4 * i; k < 4 * i + 4; ++k) {
        const Vec3 f_T = R_TC * rays_[k];
        const Vec3 hit = p_TC - p_TC.z() / f_T.z() * f_T;
        white += f_T.z() * p_TC.z() < 0 && is_black(hit) ? 0 : 1;
      }
      image.pixels[i] = static_cast<std::uint8_t>(40 + 45 * white);
    }
    return image;
  }

 private:
  static constexpr double kDot_m = 1e-4;
  bool is_black(const Vec3& p_T) const {
    if (!(std::abs(p_T.x()) < 10 && std::abs(p_T.y()) < 10)) return false;  // far beyond the board
    const int x = static_cast<int>(std::floor((p_T.x() + margin_) / kDot_m));
    const int y = static_cast<int>(std::floor((p_T.y() + margin_) / kDot_m));
    return x >= 0 && y >= 0 && x < columns_ && y < rows_ && black_[index(x, y)] != 0;
  }
  int dot(double m) const { return static_cast<int>(std::lround((m + margin_) / kDot_m)); }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x);
  }
  Camera camera_;
  double margin_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> black_;
  std::vector<Vec3> rays_;
};

}  // namespace epiline
