#pragma once
// The threads that read camera and IMU for a recording. Neither waits for the disk: if a ring is full, the newest
// element is dropped and counted.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "platform/concurrency/parking.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/ports/ports.h"
#include "platform/time/interval_tracker.h"

namespace epiline {

/// An image that waits for the disk.
struct WaitingImage {
  /// Of each camera's image; none: it has none. The pixels stand one behind the other.
  std::array<std::optional<HostStamp>, kMostOthers + 1> stamps;
  std::uint16_t buffer = 0;
};

/// Copies images into its own buffers, so that the driver gets its buffers back at once.
class ImageIntake {
 public:
  /// `wakes`: wakes the writing thread at each image. `cameras`: 1 and the others that the camera has.
  ImageIntake(CameraSource& camera, std::size_t waiting_bytes, Parking& wakes, std::size_t cameras = 1)
      : camera_(camera), waiting_bytes_(waiting_bytes), cameras_(cameras), wakes_(wakes) {}

  /// Called by the reading thread: waits for one image. False: the source has ended.
  bool step() noexcept;

  // Writing thread only.
  const WaitingImage* front() noexcept { return waiting_.front(); }
  /// Of that camera, which must have one.
  Frame image_of(const WaitingImage& waiting, std::size_t camera) const noexcept;
  /// Releases the buffer of front().
  void pop() noexcept;

  // Any thread: recent values.
  std::uint64_t missed() const noexcept { return missed_.load(std::memory_order_relaxed); }
  std::uint64_t unwritten() const noexcept { return unwritten_.load(std::memory_order_relaxed); }
  std::uint64_t old() const noexcept { return old_.load(std::memory_order_relaxed); }
  std::uint64_t resized() const noexcept { return resized_.load(std::memory_order_relaxed); }
  /// 0: no image yet. The height is known if the width is.
  int width() const noexcept { return width_.load(std::memory_order_acquire); }
  int height() const noexcept { return height_; }
  std::int64_t newest_ns() const noexcept { return newest_ns_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::size_t kFewest = 4, kMost = 64;

  void take(const Frame& frame, const OtherFrames& others) noexcept;
  void copy(const Frame& from, std::size_t camera, WaitingImage& to) noexcept;
  void make_buffers(const Frame& first) noexcept;
  bool find_buffer(std::uint16_t& buffer) noexcept;

  CameraSource& camera_;
  const std::size_t waiting_bytes_, cameras_;
  Parking& wakes_;

  // Written by the reading thread; the writing thread sees them through the ring.
  std::vector<std::uint8_t> pixels_;
  std::size_t image_bytes_ = 0, buffers_ = 0, used_ = 0;
  std::uint64_t sequence_ = 0;
  HostStamp last_;
  int height_ = 0;

  std::atomic<int> width_{0};
  SpscRing<WaitingImage, kMost> waiting_;
  SpscRing<std::uint16_t, kMost> given_back_;
  std::atomic<std::uint64_t> missed_{0}, unwritten_{0}, old_{0}, resized_{0};
  std::atomic<std::int64_t> newest_ns_{0};  ///< monotonic_ns() of the newest image; 0: none
};

class ReadingIntake {
 public:
  /// `turns`: receives the rotation rate, rad/s; may be empty.
  ReadingIntake(ImuSource& imu, const std::function<void(double)>& turns) : imu_(imu), turns_(turns) {}

  /// As ImageIntake::step().
  bool step() noexcept;

  bool pop(ImuSample& sample) noexcept { return waiting_.pop(sample); }  ///< the writing thread

  // Any thread: recent values.
  std::uint64_t missed() const noexcept { return missed_.load(std::memory_order_relaxed); }
  std::uint64_t unwritten() const noexcept { return waiting_.dropped(); }
  std::int64_t newest_ns() const noexcept { return newest_ns_.load(std::memory_order_relaxed); }

 private:
  void take(const ImuSample& sample) noexcept;

  ImuSource& imu_;
  const std::function<void(double)>& turns_;
  IntervalTracker interval_;
  HostStamp last_;
  SpscRing<ImuSample, 8192> waiting_;  // eight seconds at 1 kHz
  std::atomic<std::uint64_t> missed_{0};
  std::atomic<std::int64_t> newest_ns_{0};
};

}  // namespace epiline
