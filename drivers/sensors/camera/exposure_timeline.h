#pragma once
// Tracks the exposure of each image. A camera applies a change of exposure or gain some images after the request. The
// delay must be known to keep timestamps at mid-exposure, and by the exposure controller. docs/camera.md.
#include <array>
#include <cstddef>
#include <cstdint>

#include "platform/memory/fixed_vector.h"
#include "platform/time/clock.h"

namespace epiline {

struct ExposureState {
  Span time;
  double gain = 1;  ///< amplification
  double total() const noexcept { return time.seconds() * gain; }
};

/// Learns how many images after a change do not show it yet, from the step of the brightness that the change causes.
class ExposureDelay {
 public:
  static constexpr int kMost = 4;

  /// Exposure times gain is multiplied by `ratio` with a change; the image before it had mean brightness `before`.
  void begin(double ratio, double before) noexcept;
  /// Mean brightness of the image `index` after the change (0: the first stamped after it), in order.
  void see(std::uint64_t index, double mean) noexcept;
  /// Abandons the measurement: another change came too early, or the light changed for another reason.
  void give_up() noexcept { log_ratio_ = 0; }

  /// Most votes; -1 as long as they do not agree.
  int delay() const noexcept;

 private:
  static constexpr std::size_t kImages = kMost + 2;

  void judge() noexcept;

  double log_ratio_ = 0;                   ///< 0: not looking
  std::array<double, kImages + 1> log_{};  ///< of the mean: before the change, then of the images after it
  std::uint64_t seen_ = 0;
  std::array<int, kMost + 1> votes_{};
};

/// Belongs to the thread that reads the camera; no heap.
class ExposureTimeline {
 public:
  /// `delay`: images stamped after a change that do not show it yet; -1: to be learned, until then 1 is assumed.
  explicit ExposureTimeline(int delay) noexcept : known_delay_(delay) {}

  /// A stream begins with this exposure.
  void begin(const ExposureState& state) noexcept;
  /// The camera was told to change at this instant of the clock of its stamps.
  void change(HostStamp at, const ExposureState& state) noexcept;

  struct OfImage {
    ExposureState state;
    bool is_settled = true;  ///< shows every change for sure
  };
  /// The next image, by the driver's own stamp and the number that counts lost ones.
  OfImage image(HostStamp stamp, std::uint64_t sequence) noexcept;
  /// The image's mean brightness, if it was computed; used to learn the delay.
  void brightness(double mean) noexcept;

  int delay() const noexcept;
  bool is_delay_known() const noexcept { return known_delay_ >= 0 || learned_.delay() >= 0; }

 private:
  static constexpr std::size_t kChanges = 8;
  struct Change {
    HostStamp at;
    ExposureState state;
    std::uint64_t first = 0;  ///< number of the first image stamped after it
    bool is_numbered = false;
  };

  void number_changes(HostStamp stamp, std::uint64_t sequence) noexcept;

  int known_delay_;
  ExposureDelay learned_;
  ExposureState current_;                  ///< of the newest image
  FixedVector<Change, kChanges> changes_;  ///< not shown yet, oldest first
  std::uint64_t settled_from_ = 0;
  HostStamp stamp_;
  std::uint64_t sequence_ = 0;
  bool any_ = false;
  double mean_ = 0;
  // of the change that is learned from
  std::uint64_t learning_first_ = 0;
  bool is_learning_ = false;
};

}  // namespace epiline
