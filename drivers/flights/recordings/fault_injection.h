#pragma once
// Simulates sensor faults between a recording and the pipeline, to test that each is detected, reported and survived.
// docs/troubleshooting.md.
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "platform/error/result.h"
#include "platform/ports/ports.h"

namespace epiline {

enum class FaultKind : std::uint8_t {
  kCameraSilent,
  kCameraAhead,
  kCameraBehind,
  kCameraFrozen,
  kCameraBlack,
  kCameraWhite,
  kCameraHalf,
  kCameraExposure,
  kImuSilent,
  kImuDuplicates,
  kImuDisorder,
  kImuNan,
  kImuSaturated,
  kImuStuck,
  kImuOutlier,
  kImuAhead,
  kImuBehind,
  kImuDrift,
};

struct FaultInfo {
  FaultKind kind;
  const char* name;
  double usual_duration_s;
  const char* what;
};
/// All faults, in the order of the enum, for command line, help and tests.
std::span<const FaultInfo> all_faults() noexcept;
const char* to_string(FaultKind kind) noexcept;
bool is_of_imu(FaultKind kind) noexcept;

/// A fault and its time, in seconds after the first image. It goes by `arrival`, because timestamps may be wrong.
struct Fault {
  FaultKind kind = FaultKind::kCameraSilent;
  double from_s = 0, duration_s = 0;
};

/// NAME@SECONDS[:DURATION], as `imu-silent@10:0.1`.
Result<Fault> fault_from(const std::string& text);

/// When faults are there.
class FaultTimes {
 public:
  /// `zero`: the time from which the faults' times count.
  FaultTimes(std::span<const Fault> faults, HostStamp zero);

 protected:
  /// Null: there is none of that kind at that time.
  const Fault* active(FaultKind kind, HostStamp arrival) const noexcept;

  std::vector<Fault> faults_;
  HostStamp zero_;
};

/// Applies faults to each IMU sample.
class ImuFaults : FaultTimes {
 public:
  static constexpr std::size_t kMost = 3;  ///< most samples that one sample turns into

  /// `first_image`: the time from which the faults' times count. Ignores faults of cameras.
  ImuFaults(std::span<const Fault> faults, HostStamp first_image) : FaultTimes(faults, first_image) {}
  /// Writes the samples to deliver now into `out`; returns their number. Samples in order of arrival.
  std::size_t apply(const ImuSample& reading, std::array<ImuSample, kMost>& out) noexcept;

 private:
  void change(ImuSample& reading) noexcept;

  std::uint64_t count_ = 0;
  std::optional<ImuSample> held_, stuck_;
};

/// Applies faults to each image.
class CameraFaults : FaultTimes {
 public:
  /// `buffers`: how many images may be lent at a time; their slots count from 0. Allocates a copy of each.
  CameraFaults(std::span<const Fault> faults, HostStamp first_image, int width, int height, std::size_t buffers);
  /// Changes the image. Its pixels then lie in memory of this object, until the slot is used again. False: the image is
  /// not delivered.
  bool apply(Frame& image) noexcept;

 private:
  /// A modifiable copy of the image.
  std::uint8_t* own(Frame& image) noexcept;

  std::size_t pixels_;
  std::vector<std::vector<std::uint8_t>> copies_;
  std::vector<std::uint8_t> frozen_;
  bool has_frozen_ = false;
  std::size_t next_copy_ = 0;
  std::uint32_t noise_ = 1;
};

/// An IMU with faults.
class FaultyImu final : public ImuSource {
 public:
  FaultyImu(ImuSource& imu, const ImuFaults& faults) : imu_(imu), faults_(faults) {}
  Status open() override { return imu_.open(); }
  void close() noexcept override { imu_.close(); }
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override;

 private:
  static constexpr std::size_t kChunk = 16;
  ImuSource& imu_;
  ImuFaults faults_;
};

/// A camera with faults.
class FaultyCamera final : public CameraSource {
 public:
  FaultyCamera(CameraSource& camera, CameraFaults faults) : camera_(camera), faults_(std::move(faults)) {}
  Status open() override { return camera_.open(); }
  void close() noexcept override { camera_.close(); }
  ReadOutcome read(Frame& frame, Span timeout) noexcept override;
  OtherFrames others(const Frame& frame) const noexcept override { return camera_.others(frame); }
  void give_back(const Frame& frame) noexcept override { camera_.give_back(frame); }

 private:
  CameraSource& camera_;
  CameraFaults faults_;
};

}  // namespace epiline
