#include "pipeline/vision/detector.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace epiline {
namespace {

constexpr int kMinCellSide = 16;      // px; smaller cells would hold less than a corner's surroundings
constexpr int kPreferredStride = 37;  // spreads the first visits over the image

int cells_along(double length, double side) {
  const int fewest = static_cast<int>(std::ceil(length / kMaxCellSide));
  const int most = static_cast<int>(length) / kMinCellSide;
  return std::max(fewest, std::min(most, static_cast<int>(std::lround(length / side))));
}

int even(int n) { return n & ~1; }

}  // namespace

Detector::Detector(int width, int height, const TrackerConfig& config, const Mask* mask) : config_(config) {
  const int w = width - 2 * config.border_px, h = height - 2 * config.border_px;
  if (w < kMinCellSide || h < kMinCellSide) throw std::invalid_argument("image too small for its border");
  const double side =
      std::sqrt(w * static_cast<double>(h) / (config.cells_per_feature * static_cast<double>(config.max_features)));
  columns_ = cells_along(w, side);
  rows_ = cells_along(h, side);
  cell_width_ = even(w / columns_);
  cell_height_ = even(h / rows_);
  used_.resize(static_cast<std::size_t>(columns_) * rows_);
  own_ = OwnParts(columns_ * rows_);
  own_cells_ = {width, height, columns_, rows_, config_.border_px, cell_width_, cell_height_, {}};
  stride_ = kPreferredStride;
  while (std::gcd(stride_, columns_ * rows_) != 1) ++stride_;
  for (int i = 0; i < columns_ * rows_; ++i) {
    const Cell whole{config_.border_px + i % columns_ * cell_width_, config_.border_px + i / columns_ * cell_height_,
                     cell_width_, cell_height_};
    cells_.push_back(mask ? mask->seen_part(whole) : whole);
  }
}

// What lies outside the grid counts for the nearest cell.
int Detector::cell_at(float x, float y) const noexcept {
  const int c = (static_cast<int>(x) - config_.border_px) / cell_width_;
  const int r = (static_cast<int>(y) - config_.border_px) / cell_height_;
  return std::clamp(r, 0, rows_ - 1) * columns_ + std::clamp(c, 0, columns_ - 1);
}

void Detector::watch(float x, float y, const Vec2& turned, bool vehicle) noexcept {
  const int cell = cell_at(x, y);
  vehicle ? own_.add_vehicle(cell, turned) : own_.add_world(cell, turned);
  own_cells_.set(cell, own_.is_own(cell));
}

Discs Detector::discs_near(const Cell& cell, std::span<const std::array<float, 2>> taken,
                           const TrackTable& tracks) noexcept {
  const float radius = config_.min_distance_px;
  const float left = static_cast<float>(cell.x) - radius, right = static_cast<float>(cell.x + cell.width) + radius;
  const float top = static_cast<float>(cell.y) - radius, bottom = static_cast<float>(cell.y + cell.height) + radius;
  Discs near{near_x_.data(), near_y_.data(), 0, radius};
  const auto add = [&](float x, float y) {
    if (x < left || x > right || y < top || y > bottom) return;
    near_x_[near.count] = x;
    near_y_[near.count++] = y;
  };
  for (int i = 0; i < tracks.size; ++i) add(tracks.x[i], tracks.y[i]);
  for (const std::array<float, 2>& other : taken) add(other[0], other[1]);
  return near;
}

int Detector::detect(const ImageView& image, std::span<const std::array<float, 2>> taken, int most,
                     TrackTable& tracks) noexcept {
  const int before = tracks.size, cells = columns_ * rows_;
  taken = taken.first(std::min(taken.size(), std::size_t{TrackTable::kCapacity}));
  std::fill(used_.begin(), used_.end(), std::uint8_t{0});
  for (int i = 0; i < tracks.size; ++i) used_[cell_at(tracks.x[i], tracks.y[i])] = 1;
  for (const std::array<float, 2>& other : taken) used_[cell_at(other[0], other[1])] = 1;
  for (int k = 0; k < cells && tracks.size < most; ++k) {
    const int index = (first_ + k * stride_) % cells;
    if (used_[index]) continue;
    const Cell& here = cell(index);
    if (here.width == 0 || own_.is_own(index)) continue;
    const Corner corner = best_corner(image, here, discs_near(here, taken, tracks), config_.edge_share);
    if (corner.score < config_.min_score) continue;
    tracks.x[tracks.size] = corner.x;
    tracks.y[tracks.size++] = corner.y;
  }
  first_ = (first_ + 1) % cells;
  return tracks.size - before;
}

}  // namespace epiline
