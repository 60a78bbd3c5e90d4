#pragma once
// Two cameras that are triggered together, each with a device of its own. docs/camera.md#two-cameras.
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>

#include "platform/concurrency/parking.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/linux/realtime.h"
#include "platform/ports/counter.h"
#include "platform/ports/ports.h"

namespace epiline {

struct PairCounts {
  std::uint64_t pairs = 0;    ///< images of the first camera that have one of the second
  std::uint64_t without = 0;  ///< those that have none: the second camera lost it, or took it at another time
  std::uint64_t unused = 0;   ///< images of the second camera that belong to none of the first
};
inline constexpr auto kPairCounters = std::to_array<Counter<PairCounts>>({
    {"pairs", &PairCounts::pairs},
    {"without", &PairCounts::without},
    {"unused", &PairCounts::unused},
});

struct PairSettings {
  Span within = Span::from_milliseconds(1);  ///< images of one pair are no farther apart
  Span second_later{};  ///< what is added to the second camera's stamps to be on the first one's clock
  Span patience = Span::from_milliseconds(10);  ///< how much later the second one may come: both share a bus
  int priority = 0, cpu = -1;                   ///< of the thread that reads the second camera; see ThreadSettings
};

/// The first camera leads: its images come as from it alone, whatever the second one does, but for the time in which
/// the second one's image may still come. The second camera has a thread of its own, so that neither waits while the
/// other one is lost and opened again.
class CameraPair final : public CameraSource {
 public:
  static constexpr int kMostSlots = 64;  ///< of the first camera

  CameraPair(std::unique_ptr<CameraSource> first, std::unique_ptr<CameraSource> second, const PairSettings& settings)
      : first_(std::move(first)), second_(std::move(second)), settings_(settings) {}
  ~CameraPair() override { close(); }

  /// Both must open.
  Status open() override;
  void close() noexcept override;
  ReadOutcome read(Frame& frame, Span timeout) noexcept override;
  Frame second(const Frame& frame) const noexcept override;
  void give_back(const Frame& frame) noexcept override;

  PairCounts counts() const noexcept;

 private:
  /// After so many images without a second one nobody waits for it any more.
  static constexpr int kPatient = 3;

  void read_second() noexcept;
  /// The image of the second camera that was taken at that time, if it is there.
  bool match(HostStamp stamp, Frame& second) noexcept;

  std::unique_ptr<CameraSource> first_, second_;
  PairSettings settings_;
  SpscRing<Frame, 4> ring_;                    ///< images of the second camera
  Parking came_;                               ///< one of them
  std::array<Frame, kMostSlots> second_of_{};  ///< by the first one's slot
  int missed_ = 0;                             ///< in a row
  std::atomic<bool> stops_{true};
  std::atomic<std::uint64_t> pairs_{0}, without_{0}, unused_{0};
  RealtimeThread thread_;
};

}  // namespace epiline
