#pragma once
// The state of the live view: collected from the feed, returned as JSON. Bounded memory, one thread.
#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/program/view/view_feed.h"
#include "drivers/study/replay/flight_view.h"
#include "drivers/study/report/errors_json.h"
#include "estimator/geometry/types.h"
#include "platform/time/latency_bins.h"

namespace epiline {

/// The data that a page already has; it gets only newer data.
struct ViewCursor {
  std::uint64_t path_generation = 0, path = 0, sample = 0, event = 0;
};

/// The path as points at least one step apart. When it is full, every second point is dropped and the step doubles.
class PathHistory {
 public:
  static constexpr std::size_t kMostPoints = 4096;
  struct Point {
    std::array<float, 3> p_W{};
    HealthState state = HealthState::kInitialising;
  };

  PathHistory() { points_.reserve(kMostPoints); }
  void add(const std::array<double, 3>& p_W, HealthState state);
  const std::vector<Point>& points() const { return points_; }
  /// Increases when points are dropped, so that pages must fetch the whole path again.
  std::uint64_t generation() const { return generation_; }
  double step_m() const { return step_m_; }
  /// Length of the path along the points, m.
  double length_m() const { return length_m_; }

 private:
  std::vector<Point> points_;
  std::uint64_t generation_ = 1;
  double step_m_ = 0.02, length_m_ = 0;
  std::optional<std::array<double, 3>> last_;
};

/// Events per second by their timestamps, over the last two seconds.
class RateMeter {
 public:
  /// Notes that the event number `count` was at `stamp`.
  void note(std::uint64_t count, HostStamp stamp);
  /// Events per second; 0 until there are two notes.
  double hz() const;

 private:
  struct Reading {
    std::uint64_t count = 0;
    HostStamp stamp;
  };
  static constexpr std::size_t kMostReadings = 512;
  std::deque<Reading> readings_;
};

class ViewModel {
 public:
  explicit ViewModel(ViewSubject subject);

  void take(const ViewedOutcome& outcome);
  void take(const Publication& latency);
  void take(const Event& event);
  void set_left_out(std::uint64_t count) { left_out_ = count; }
  void set_newest_image(std::uint64_t sequence) { newest_image_ = sequence; }
  /// What receivers of the odometry say, a sentence each.
  void set_notes_of_receivers(std::vector<std::string> notes) { notes_of_receivers_ = std::move(notes); }
  /// The run is over; what the page shows is final.
  void finish() { finished_ = true; }
  bool finished() const { return finished_; }

  /// The answer to `/state`.
  std::string state_json(const ViewCursor& since) const;

 private:
  static constexpr std::size_t kSamples = 2048, kEvents = 128;
  /// Values of an image that the page draws over time.
  struct Sample {
    double t_s = 0, latency_ms = -1;  ///< negative: not known
    std::array<double, 3> v_W{};
    int quality = 0, tracks = 0;
    HealthState state = HealthState::kInitialising;
    bool has_pose = false;
  };
  struct Note {
    double t_s = 0;
    const char* kind = "";
    std::string text;
    Json details;
  };

  double seconds(HostStamp stamp) const { return began_ ? (stamp - *began_).seconds() : 0; }
  void note(double t_s, const char* kind, std::string text, Json details);
  void note_changes(const ViewedOutcome& now);
  Json pose_json() const;
  Json path_json(const ViewCursor& since) const;
  Json samples_json(const ViewCursor& since) const;
  Json events_json(const ViewCursor& since) const;

  ViewSubject subject_;
  std::uint64_t run_;  ///< tells a page that another program answers now
  std::optional<HostStamp> began_;
  std::optional<ViewedOutcome> newest_;
  BackEnd::Times solved_times_;
  PathHistory path_;
  LatencyBins latencies_;
  RateMeter images_, imu_;
  std::vector<Sample> samples_ = std::vector<Sample>(kSamples);
  std::uint64_t samples_end_ = 0, last_latency_serial_ = 0;
  bool has_latency_ = false;
  std::vector<Note> notes_ = std::vector<Note>(kEvents);
  std::uint64_t notes_end_ = 0, solved_ = 0, left_out_ = 0, newest_image_ = 0;
  std::vector<std::string> notes_of_receivers_;
  bool finished_ = false;
};

/// The header of `/frame`: which image, and its tracks.
std::string tracks_json(const ViewedImage& image);

}  // namespace epiline
