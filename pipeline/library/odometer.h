#pragma once
// Odometry for a program that has the samples itself: it pushes IMU samples and images, or tracks, and steps. The same
// samples give the same odometry as `epiline replay`, bit by bit.
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "pipeline/config/calibration.h"
#include "pipeline/config/config.h"
#include "pipeline/stages/imu_feed.h"
#include "pipeline/stages/offline.h"

namespace epiline {

/// All calls from one thread. After the construction nothing is allocated, except for the text of an error.
class Odometer {
 public:
  static constexpr std::size_t kMostImages = 4;  ///< that wait for a step

  /// `settings.images` false: tracks; `recorded` and `log` are not used. Throws std::invalid_argument for settings that
  /// contradict each other.
  explicit Odometer(const OfflineSettings& settings);
  /// Reads the calibration files that the settings name. Fails if and only if `camera.calibration` is not set, a
  /// calibration cannot be read, or settings contradict each other.
  static Result<std::unique_ptr<Odometer>> create(const ConfigFile& settings, bool images);

  // Each sensor's samples in the order of time. Stamps are those of one clock, an image's that of its mid-exposure.

  /// Fails if and only if too many samples wait because no image is stepped.
  Status push_imu(const ImuSample& sample);
  /// Copies the pixels. Fails if and only if kMostImages wait, or the size is not that of the calibration.
  Status push_image(const Frame& image);
  /// Points of one image: raw pixels, each id once. Fails if and only if kMostImages wait or there are too many points.
  Status push_tracks(HostStamp stamp, std::span<const TrackPoint> points);
  /// Fail if and only if too many samples wait because no image is stepped.
  Status push_wheel(const WheelSample& sample);
  Status push_height(const HeightSample& sample);
  /// No more samples come: the images that wait need no later ones.
  void end() noexcept { ended_ = true; }

  /// Estimates the oldest image that waits. False: there is none, or the IMU samples up to it have not come yet. An
  /// image that the input watch refuses (older than the one before) is left out.
  bool step() noexcept;

  /// What came of the last image; its odometry counts if `result.has_pose`.
  const FrameOutcome& outcome() const noexcept { return outcome_; }
  const EstimatorStats& stats() const noexcept { return pipeline_.estimator().stats(); }
  const CameraParameters& camera() const noexcept { return camera_; }

 private:
  /// One waits, and its pixels or points stay until the tracker has seen the next one.
  struct Buffer {
    std::vector<std::uint8_t> pixels;
    std::vector<TrackPoint> points;
    bool in_use = false;
  };
  struct Waiting {
    Frame frame;
    std::size_t buffer = 0;
  };
  template <class Ring>
  struct Side {
    Ring ring;
    std::optional<HostStamp> last{};  ///< given to the pipeline
  };

  Waiting* claim(HostStamp stamp) noexcept;
  bool feed_imu(HostStamp image) noexcept;
  void give_oldest_imu() noexcept;
  void feed_sides(HostStamp image) noexcept;
  void done_with(const Waiting& image) noexcept;

  bool images_;  ///< false: tracks
  CameraParameters camera_;
  OfflinePipeline pipeline_;
  std::array<Buffer, kMostImages + 1> buffers_;  // the tracker keeps one
  std::array<Waiting, kMostImages> waiting_{};
  std::size_t waiting_count_ = 0;
  std::optional<std::size_t> kept_;  ///< buffer of the tracker's last image
  std::uint64_t sequence_ = 0;
  bool ended_ = false;
  std::optional<Frame> admitted_;  ///< the oldest that waits, after the watch
  ImuRing imu_;
  ImuFeed feed_;
  Side<WheelRing> wheel_;
  Side<HeightRing> height_;
  FrameOutcome outcome_;
};

}  // namespace epiline
