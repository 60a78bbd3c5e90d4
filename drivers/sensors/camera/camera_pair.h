#pragma once
// Cameras, each with a device of its own, triggered together or not. docs/camera.md#several-cameras.
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

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
  std::uint64_t alone = 0;    ///< images of the second camera that went on without the first, which was silent
};
inline constexpr auto kPairCounters = std::to_array<Counter<PairCounts>>({
    {"pairs", &PairCounts::pairs},
    {"without", &PairCounts::without},
    {"unused", &PairCounts::unused},
    {"alone", &PairCounts::alone},
});

struct PairSettings {
  Span within = Span::from_milliseconds(1);  ///< images of one pair are no farther apart
  Span second_later{};  ///< what is added to the second camera's stamps to be on the first one's clock
  Span patience = Span::from_milliseconds(10);  ///< how much later the second one may come: both share a bus
  int width = 0, height = 0;                    ///< of the black images for a silent first camera; 0: it gets none
  int priority = 0, cpu = -1;                   ///< of the thread that reads the second camera; see ThreadSettings
  std::size_t number = 1;                       ///< of the second camera, 1 to 3
};

/// The first camera leads: its images come as from it alone, whatever the second one does, but for the time in which
/// the second one's image may still come. The second camera has a thread of its own, so that neither waits while the
/// other one is lost and opened again. If the settings say so, images of the second one go on while the first one is
/// silent, each with a black image in the first one's place, as from a covered lens. For a third camera the first one
/// is the pair of both before it, and so on.
class CameraPair final : public CameraSource {
 public:
  static constexpr int kMostSlots = 64;  ///< of each camera

  CameraPair(std::unique_ptr<CameraSource> first, std::unique_ptr<CameraSource> second, const PairSettings& settings)
      : first_(std::move(first)), second_(std::move(second)), settings_(settings) {}
  ~CameraPair() override { close(); }

  /// Both must open.
  Status open() override;
  void close() noexcept override;
  ReadOutcome read(Frame& frame, Span timeout) noexcept override;
  OtherFrames others(const Frame& frame) const noexcept override;
  void give_back(const Frame& frame) noexcept override;

  PairCounts counts() const noexcept;

 private:
  /// After so many images without a second one nobody waits for it any more.
  static constexpr int kPatient = 3;

  void read_second() noexcept;
  /// An image of the first camera. False: it is older than one of the second camera that went on alone.
  bool lead(const Frame& frame) noexcept;
  /// Of an image that may not go on: a later one has.
  bool is_old(HostStamp stamp) const noexcept;
  /// True if the last image came so long ago that the first camera counts as silent.
  bool is_overdue(std::int64_t last_ns) const noexcept;
  bool stand_in(Frame& frame, Span timeout) noexcept;
  /// Slots of its images that go on alone: from here on.
  int slots_alone() const noexcept { return static_cast<int>(settings_.number) * kMostSlots; }
  /// The image of the second camera that was taken at that time, if it is there.
  bool match(HostStamp stamp, Frame& second) noexcept;

  std::unique_ptr<CameraSource> first_, second_;
  PairSettings settings_;
  SpscRing<Frame, 4> ring_;                                        ///< images of the second camera
  Parking came_;                                                   ///< one of them
  std::array<Frame, (kMostOthers + 1) * kMostSlots> second_of_{};  ///< by slot
  std::vector<std::uint8_t> black_;
  int missed_ = 0;                  ///< in a row
  HostStamp newest_;                ///< of the images that went on
  bool stood_in_ = false;           ///< the newest one is the second camera's
  HostStamp first_stamp_;           ///< of the first camera's newest image, ...
  std::int64_t first_came_ns_ = 0;  ///< ... when it came; 0: none came yet
  std::int64_t alone_came_ns_ = 0;  ///< when an image of the second one went on alone, last
  Span period_{};                   ///< between two of them; 0: not known
  std::uint64_t sequence_ = 0;
  std::atomic<bool> stops_{true};
  std::atomic<std::uint64_t> pairs_{0}, without_{0}, unused_{0}, alone_{0};
  RealtimeThread thread_;
};

}  // namespace epiline
