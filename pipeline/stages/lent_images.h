#pragma once
// The images that a camera has lent. Pixels are never copied: the number of a buffer goes from stage to stage, and the
// last user gives the buffer back.
#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "pipeline/stages/stage.h"
#include "platform/concurrency/loans.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/ports/ports.h"

namespace epiline {

class LentImages {
 public:
  static constexpr int kMostSlots = 256;  ///< Frame::slot is below

  /// `camera`: gets its images back; null: the caller knows by users() when it may have an image's memory again.
  explicit LentImages(CameraSource* camera) noexcept : camera_(camera) {}

  /// The image's first user, before it hands the number of the buffer on. `others` are lent
  /// and given back together with the image.
  void lend(const Frame& image, const OtherFrames& others = {}) noexcept {
    const auto slot = static_cast<std::size_t>(image.slot);
    images_[slot] = image;
    others_[slot] = others;
    loans_.lend(slot);
  }
  /// One more user. Only by a user, before it hands the number on.
  void share(std::size_t slot) noexcept { loans_.share(slot); }
  /// One user less; the last one gives the image back to the camera.
  void give_back(std::size_t slot) noexcept {
    if (loans_.give_back(slot) && camera_ != nullptr) camera_->give_back(images_[slot]);
  }
  /// Only by a user.
  const Frame& operator[](std::size_t slot) const noexcept { return images_[slot]; }
  /// The same of the other cameras.
  const OtherFrames& others(std::size_t slot) const noexcept { return others_[slot]; }
  /// Any thread: a recent value.
  std::uint32_t users(std::size_t slot) const noexcept { return loans_.users(slot); }

 private:
  CameraSource* camera_;
  std::array<Frame, kMostSlots> images_{};
  std::array<OtherFrames, kMostSlots> others_{};
  Loans<kMostSlots> loans_;
};

/// The images that the log holds: no more at a time than the camera can spare.
class LoggedImages {
 public:
  static constexpr std::size_t kMost = 8;
  using Ring = SpscRing<Frame, kMost>;

  /// `at_once`: 0 to kMost; 0: the log gets none.
  explicit LoggedImages(int at_once) noexcept
      : at_once_(static_cast<std::uint64_t>(std::clamp(at_once, 0, static_cast<int>(kMost)))) {}

  // The thread that hands images to the log.

  bool wanted() const noexcept { return at_once_ > 0; }
  /// True if the log takes the image; the log gives it back.
  bool push(const Frame& image) noexcept {
    if (!wanted() || image.data == nullptr) return false;
    if (ring_.published() - ring_.popped() < at_once_) return ring_.push(image);
    skipped_.bump();
    return false;
  }

  /// For the log.
  Ring& ring() noexcept { return ring_; }
  const Ring& ring() const noexcept { return ring_; }
  /// Any thread: images left out because the log still held as many as it may.
  std::uint64_t skipped() const noexcept { return skipped_.get(); }

 private:
  std::uint64_t at_once_;
  Ring ring_;
  StageCount skipped_;
};

}  // namespace epiline
