#pragma once
// Plays a recorded flight as a camera and an IMU: each sample is delivered at its time on the computer's clock. Its
// arrival time equals its timestamp, because recordings hold no arrival times.
#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "drivers/flights/recordings/flight_plan.h"
#include "drivers/flights/recordings/image_file.h"
#include "platform/concurrency/parking.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/linux/realtime.h"
#include "platform/ports/ports.h"
#include "platform/time/monotonic.h"
#include "platform/time/sleep.h"

namespace epiline {

/// The images, decoded ahead of time by a thread of its own. Like a camera, it does not wait for the pipeline: an image
/// that was not decoded in time, or for which no buffer is free, is missed, which shows as a gap in `sequence`.
class RecordedCamera final : public CameraSource {
 public:
  static constexpr int kImagesToLog = 8;  ///< of the 32 buffers; see RealtimeSettings
  static constexpr std::size_t kBuffers = 32;

  RecordedCamera(const AslDataset& dataset, const FlightPlan& plan);
  ~RecordedCamera() override { close(); }

  /// Starts decoding; returns when all buffers hold images. Throws std::system_error if the system cannot start a
  /// thread. For images that cannot be read, see error().
  Status open() override;
  void close() noexcept override;
  /// Once, before the first read().
  void start(const Pace& pace) noexcept;
  ReadOutcome read(Frame& frame, Span timeout) noexcept override;
  OtherFrames others(const Frame& frame) const noexcept override;
  void give_back(const Frame& frame) noexcept override;

  std::uint64_t missed() const noexcept { return missed_.load(std::memory_order_relaxed); }
  /// After the end: the image that was no image of this camera, if the recording ended for that.
  const std::optional<Error>& error() const noexcept { return error_; }
  /// After the end: images that were left out, of all cameras.
  UnreadableImages unreadable() const {
    UnreadableImages all = decoder_.unreadable();
    for (const ImageDecoder& other : other_decoders_) all.add(other.unreadable());
    return all;
  }

 private:
  void decode_all();
  Status decode(std::size_t i, std::size_t slot, Frame& frame);
  bool is_overdue(std::size_t i) const noexcept;
  int free_slot() const noexcept;
  int wait_for_slot() noexcept;

  const AslDataset& dataset_;
  const FlightPlan& plan_;
  ImageDecoder decoder_{kBuffers};
  std::array<ImageDecoder, kMostOthers> other_decoders_{ImageDecoder{kBuffers}, ImageDecoder{kBuffers},
                                                        ImageDecoder{kBuffers}};
  std::array<OtherFrames, kBuffers> others_{};        ///< by buffer
  std::array<std::atomic<bool>, kBuffers> in_use_{};  ///< from wait_for_slot() to give_back()
  SpscRing<Frame, kBuffers> ready_;
  Parking reader_parking_, decoder_parking_;
  Pace pace_;
  std::atomic<bool> started_{false}, closing_{false}, ended_{false};
  std::atomic<std::uint64_t> missed_{0};
  std::optional<Error> error_;
  RealtimeThread decoder_thread_;  ///< without priority: it stands for the camera
};

/// A reading of a recording with its arrival.
inline ImuSample arrived(ImuSample reading) noexcept {
  reading.arrival = reading.stamp;
  return reading;
}

/// The readings, in the recording's order.
class RecordedImu final : public ImuSource {
 public:
  RecordedImu(const AslDataset& dataset, const FlightPlan& plan)
      : samples_(dataset.imu_samples), next_(plan.first_imu) {}

  Status open() override { return Done{}; }
  void close() noexcept override {}
  /// Once, before the first read().
  void start(const Pace& pace) noexcept { pace_ = pace; }
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override;

 private:
  const std::vector<ImuSample>& samples_;
  std::size_t next_;
  Pace pace_;
};

/// The samples of a sensor besides camera and IMU, in the recording's order.
template <class Sample>
class RecordedSamples final : public SampleSource<Sample> {
 public:
  explicit RecordedSamples(const std::vector<Sample>& samples) : samples_(samples) {}

  Status open() override { return Done{}; }
  void close() noexcept override {}
  /// Once, before the first read(). Samples from before that time are left out.
  void start(const Pace& pace) noexcept {
    pace_ = pace;
    while (next_ < samples_.size() && samples_[next_].stamp < pace.stamp) ++next_;
  }
  ReadOutcome read(Sample& sample, Span timeout) noexcept override {
    if (next_ == samples_.size()) return ReadOutcome::kEnd;
    const std::int64_t deadline_ns = monotonic_ns() + timeout.ns, due_ns = pace_.host_of(samples_[next_].stamp);
    sleep_until(std::min(due_ns, deadline_ns));
    if (due_ns > deadline_ns) return ReadOutcome::kTimeout;
    sample = samples_[next_++];
    return ReadOutcome::kSample;
  }

 private:
  const std::vector<Sample>& samples_;
  std::size_t next_ = 0;
  Pace pace_;
};

}  // namespace epiline
