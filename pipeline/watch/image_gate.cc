#include "pipeline/watch/image_gate.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace epiline {

namespace {
constexpr double kFlat = 2.5;        // grey levels, standard deviation in a cell: no more than a dark sensor's noise
constexpr double kCovered = 0.97;    // share of flat cells
constexpr double kObstructed = 0.3;  // flat cells more than usual
constexpr int kCopies = 3;  // in a row: of a driver that gives up to four images for each one that its sensor takes
constexpr double kUsualMemory_s = 5;
constexpr double kExposureStep = 1.4;  // ratio of mean brightness from image to image

/// FNV-1a over whole rows, eight pixels at a time: single pixels may stay as they are while a plain pattern moves.
std::uint64_t fingerprint_of(const Frame& image, int rows) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (int i = 0; i < rows; ++i) {
    const std::uint8_t* const row = image.data + static_cast<std::ptrdiff_t>(i * image.height / rows) * image.stride;
    for (int x = 0; x + 8 <= image.width; x += 8) {
      std::uint64_t pixels = 0;
      std::memcpy(&pixels, row + x, sizeof pixels);
      hash = (hash ^ pixels) * 1099511628211ULL;
    }
  }
  return hash;
}
}  // namespace

ImageGate::Look ImageGate::look_at(const Frame& image) noexcept {
  Look look;
  look.fingerprint = fingerprint_of(image, kCellsY * kPerCell);
  double sum = 0;
  int flat = 0;
  for (int cell_y = 0; cell_y < kCellsY; ++cell_y) {
    for (int cell_x = 0; cell_x < kCellsX; ++cell_x) {
      int total = 0, squares = 0;
      for (int i = 0; i < kPerCell; ++i) {
        const int y = (cell_y * kPerCell + i) * image.height / (kCellsY * kPerCell);
        const std::uint8_t* const row = image.data + static_cast<std::ptrdiff_t>(y) * image.stride;
        for (int k = 0; k < kPerCell; ++k) {
          const int value = row[(cell_x * kPerCell + k) * image.width / (kCellsX * kPerCell)];
          total += value;
          squares += value * value;
        }
      }
      constexpr double kPixels = kPerCell * kPerCell;
      const double mean = total / kPixels;
      flat += squares / kPixels - mean * mean < kFlat * kFlat ? 1 : 0;
      sum += mean;
    }
  }
  constexpr double kCells = kCellsX * kCellsY;
  look.mean = sum / kCells;
  look.flat = flat / kCells;
  return look;
}

bool ImageGate::in_order(Frame& image) noexcept {
  const StampGate::Verdict verdict = clock_.step(image.stamp, image.arrival);
  if (verdict == StampGate::Verdict::kOld) {
    ++stats_.old;
    return false;
  }
  if (verdict == StampGate::Verdict::kSuspect) {
    ++stats_.suspect;
    pending_ |= bit(HealthReason::kCameraClockJump);
    return false;
  }
  image.stamp = clock_.corrected();
  stats_.clock_steps += clock_.stepped() ? 1 : 0;
  if (clock_.stepped() || clock_.in_doubt()) image.reasons |= bit(HealthReason::kCameraClockJump);
  return true;
}

/// A driver that repeats an image has taken no new one: it is missing. More copies than that are a camera that stands
/// still, or a scene that does without any noise.
bool ImageGate::is_copy(const Look& look) noexcept {
  const bool same = any_ && look.flat < kCovered && look.fingerprint == last_.fingerprint;
  same_ = same ? same_ + 1 : 0;
  return same && same_ <= kCopies;
}

void ImageGate::judge(const Look& look, HostStamp stamp, std::uint32_t& reasons) noexcept {
  if (look.flat >= kCovered) {
    ++stats_.covered;
    reasons |= bit(HealthReason::kLensCovered);
  } else if (same_ > 0) {
    ++stats_.frozen;
    reasons |= bit(HealthReason::kImagesFrozen);
  } else {
    const double more = look.flat - usual_flat_;
    obstructed_ = any_ && more > (obstructed_ ? 0.5 * kObstructed : kObstructed);
    if (obstructed_) {
      ++stats_.obstructed;
      reasons |= bit(HealthReason::kViewObstructed);
    }
    const double ratio = (look.mean + 1) / (last_.mean + 1);
    if (any_ && !(last_.flat >= kCovered) && std::max(ratio, 1 / ratio) > kExposureStep) {
      ++stats_.exposure_steps;
      reasons |= bit(HealthReason::kExposureStep);
    }
    const double dt_s = any_ ? (stamp - last_stamp_).seconds() : kUsualMemory_s;
    usual_flat_ += std::clamp(dt_s / kUsualMemory_s, 0.0, 1.0) * more;
    last_stamp_ = stamp;
    any_ = true;
  }
  last_ = look;
}

bool ImageGate::step(Frame& image) noexcept {
  image.reasons = 0;
  if (!in_order(image)) return false;
  pending_ |= image.reasons;
  if (image.data != nullptr) {
    const Look look = look_at(image);
    if (is_copy(look)) {
      ++stats_.copies;
      return false;
    }
    judge(look, image.stamp, pending_);
  }
  image.reasons = std::exchange(pending_, 0U);
  return true;
}

}  // namespace epiline
