#pragma once
// Records the samples of camera and IMU to disk. docs/calibrate.md
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "drivers/program/live/devices.h"
#include "drivers/program/record/disk.h"
#include "platform/error/result.h"

namespace epiline {

struct RecordOptions {
  std::filesystem::path out;                                    ///< gets the folder `mav0`
  double duration_s = std::numeric_limits<double>::infinity();  ///< the recording ends after this time
  std::uint64_t keep_free_bytes = 200'000'000;                  ///< the recording ends before less is free on the disk
  std::size_t waiting_bytes = std::size_t{64} << 20;  ///< memory for images that wait for the disk, 4 to 64 images
  Disk* disk = &Disk::of_this_computer();
};

/// Numbers of images and samples so far, by outcome.
struct RecordCounts {
  std::uint64_t images = 0;            ///< written
  std::uint64_t images_missed = 0;     ///< the camera or its driver lost them
  std::uint64_t images_unwritten = 0;  ///< dropped, too many images waited: the disk or the processor is too slow
  std::uint64_t images_old = 0;        ///< not later than the image before
  std::uint64_t images_resized = 0;    ///< another size than the first image
  std::uint64_t readings = 0;          ///< written
  std::uint64_t readings_missed = 0;   ///< gaps between timestamps
  std::uint64_t readings_unwritten = 0;
  std::uint64_t lost() const {
    return images_missed + images_unwritten + images_old + images_resized + readings_missed + readings_unwritten;
  }
};

struct RecordState {
  RecordCounts counts;
  double seconds = 0;                             ///< since the devices were opened
  double image_rate_hz = 0, reading_rate_hz = 0;  ///< over the last second
  std::uint64_t bytes = 0;
  double bytes_per_s = 0;                                         ///< mean over the recording; 0: not known yet
  std::uint64_t free_bytes = 0;                                   ///< that may still be written; 0: not known
  double seconds_left = std::numeric_limits<double>::infinity();  ///< until the disk is full, at this rate
  double camera_silent_s = 0, imu_silent_s = 0;  ///< time since the newest image and sample, or since the start
  double compress_ms = 0, write_ms = 0;          ///< per image, mean of the newest ones
};

enum class RecordEnd : std::uint8_t { kSignal, kDuration, kSources, kDiskFull, kWatch };
inline constexpr const char* kRecordEndNames[] = {"signal", "duration", "sources", "disk full", "watch"};

struct RecordSummary {
  RecordState last;
  RecordEnd end = RecordEnd::kSignal;
  std::vector<DeviceRecord> devices;  ///< the drivers' counters
};

/// Opens the devices and records until SIGINT, SIGTERM, SIGHUP, the end of the sources or of the duration, until the
/// disk has only `keep_free_bytes` left, or until `watch`, called twenty times a second, returns false. Fails if and
/// only if `out` holds a recording, a device cannot be opened, the system cannot start a thread, a file cannot be
/// written, or no image or no sample came in spite of enough time. Data recorded before a failure stay.
Result<RecordSummary> record(const LiveSettings& settings, LiveDevices& devices, const RecordOptions& options,
                             const std::function<bool(const RecordState&)>& watch);

/// Lost images and samples, a line for each cause: "12 images: the disk is too slow (...)". Empty: none were lost.
std::vector<std::string> loss_lines(const RecordState& state);

}  // namespace epiline
