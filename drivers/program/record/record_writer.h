#pragma once
// The thread that writes a recording: readings first, then one image after the other.
#include <atomic>
#include <cstdint>
#include <optional>
#include <thread>

#include "drivers/program/record/recording_files.h"
#include "drivers/program/record/sample_intake.h"
#include "platform/concurrency/parking.h"

namespace epiline {

class RecordWriter {
 public:
  RecordWriter(RecordingFiles& files, ImageIntake& images, ReadingIntake& readings, Parking& wake)
      : files_(files), images_in_(images), readings_in_(readings), wake_(wake) {}
  ~RecordWriter() { stop(Span{0}); }
  RecordWriter(const RecordWriter&) = delete;
  RecordWriter& operator=(const RecordWriter&) = delete;

  /// Throws std::system_error if the system cannot start a thread.
  void start();
  /// Call after the intakes have stopped. Writes all waiting samples, and waiting images for `at_most` this long.
  void stop(Span at_most);

  // Any thread: recent values.
  std::uint64_t images() const noexcept { return images_.load(std::memory_order_relaxed); }
  std::uint64_t readings() const noexcept { return readings_.load(std::memory_order_relaxed); }
  std::uint64_t bytes() const noexcept { return bytes_.load(std::memory_order_relaxed); }
  std::uint64_t rounds() const noexcept { return rounds_.load(std::memory_order_relaxed); }
  double compress_ms() const noexcept { return compress_ms_.load(std::memory_order_relaxed); }
  double write_ms() const noexcept { return write_ms_.load(std::memory_order_relaxed); }
  bool has_failed() const noexcept { return failed_.load(std::memory_order_acquire); }
  /// Valid once has_failed() is true.
  const Error& failure() const { return *failure_; }

  /// Valid after stop(): number of images that were not written because the time was over.
  std::uint64_t left_over() const { return left_over_; }

 private:
  void run() noexcept;
  bool round();
  bool write_readings();
  bool write_image();
  bool write(std::size_t camera, const Frame& image);
  bool fail(const Error& error);

  RecordingFiles& files_;
  ImageIntake& images_in_;
  ReadingIntake& readings_in_;
  Parking& wake_;
  std::atomic<bool> stops_{false}, failed_{false};
  std::atomic<std::int64_t> ends_at_ns_{0};
  std::optional<Error> failure_;
  std::uint64_t left_over_ = 0;
  std::atomic<std::uint64_t> images_{0}, readings_{0}, bytes_{0}, rounds_{0};
  std::atomic<double> compress_ms_{0}, write_ms_{0};
  std::thread thread_;
};

}  // namespace epiline
