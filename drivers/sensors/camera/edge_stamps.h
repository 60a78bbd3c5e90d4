#pragma once
// Assigns the edges of a trigger or strobe line to images. docs/camera.md
#include <array>
#include <cstddef>
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

/// The outcome of match() for an image.
enum class EdgeMatch : std::uint8_t {
  kEdge,      ///< that of its own edge: time and count agree
  kNoEdge,    ///< its edge was lost: from the edges around it, or the driver's stamp less its usual lag
  kUnsure,    ///< not known yet which edge belongs to which image: do not use the image
  kMismatch,  ///< time says one edge, count another: do not use the image
};

struct EdgeCounts {
  std::uint64_t edges = 0;    ///< taken
  std::uint64_t extra = 0;    ///< edges that came too soon after another: left out
  std::uint64_t missing = 0;  ///< edges that did not come
  std::uint64_t matched = 0, without_edge = 0, unsure = 0, mismatched = 0;  ///< images, by EdgeMatch
  std::uint64_t resynchronised = 0;  ///< the camera's or the line's count had changed for good
  Span period;                       ///< of the edges; 0: not known yet
  Span lag;                          ///< usual: start of exposure by the driver's stamp, less the edge
};

/// Matches by time: the nearest edge, where the driver's start of exposure is wrong by less than half a period; and by
/// count: from image to image, as many edges as the camera counted images. An image for which the two disagree gets no
/// stamp. Edges come at a steady rate, one for each exposure. One thread, no heap, no clock.
class EdgeStamps {
 public:
  /// Adds an edge. Call in time order, and before match() for the image of the edge.
  void add_edge(HostStamp edge) noexcept;
  /// `start`: of the image's exposure by the driver's stamp; becomes the edge's time, for kEdge and kNoEdge.
  /// `sequence` counts what the camera took.
  EdgeMatch match(std::uint64_t sequence, HostStamp& start) noexcept;
  /// Call when the camera's stream restarts and its sequence numbers begin again.
  void restart() noexcept { anchored_ = false, agreeing_ = 0; }

  const EdgeCounts& counts() const noexcept { return counts_; }

 private:
  struct Cycle {
    HostStamp edge;
    std::int64_t number = 0;  ///< of the period, lost edges counted
  };
  static constexpr std::size_t kEdges = 64;
  static constexpr int kToLearnRate = 8;  ///< intervals

  void learn(HostStamp edge, double passed_ns) noexcept;
  void push(const Cycle& cycle) noexcept;
  const Cycle& at(std::size_t i) const noexcept { return ring_[(first_ + i) % kEdges]; }
  const Cycle& nearest(HostStamp instant) const noexcept;
  double period_ns() const noexcept;
  EdgeMatch judge(std::uint64_t sequence, HostStamp& start) noexcept;
  bool agrees(std::int64_t offset, double residual_ns, int wanted) noexcept;

  HostStamp newest_;
  double usual_ns_ = 0;
  int learned_ = 0, odd_ = 0;
  std::array<double, kToLearnRate> first_intervals_ns_{};
  std::array<Cycle, kEdges> ring_{};
  std::size_t first_ = 0, count_ = 0;

  bool has_lag_ = false, anchored_ = false;
  double lag_ns_ = 0;
  std::int64_t offset_ = 0;  ///< number of an image's edge, less its sequence; if anchored
  // Images in a row that would have another offset.
  std::int64_t other_offset_ = 0;
  int agreeing_ = 0;
  double residual_least_ns_ = 0, residual_most_ns_ = 0, residual_sum_ns_ = 0;

  EdgeCounts counts_;
};

}  // namespace epiline
