#include "drivers/program/record/recording_files.h"

#include <fmt/format.h>

#include "pipeline/config/asl.h"
#include "pipeline/text/table.h"

namespace epiline {
namespace fs = std::filesystem;

namespace {

constexpr const char* kComment = "epiline record";

std::string uncalibrated(const char* missing, const char* sensor, double rate_hz) {
  return fmt::format(
      "# not calibrated: put the {} in place of this file\nsensor_type: {}\ncomment: \"{}\"\nrate_hz: {:.6g}\n",
      missing, sensor, kComment, rate_hz);
}

std::string camera_text(const RecordedSensors& s, const std::optional<CameraCalibration>& camera) {
  if (camera) return asl_camera(*camera, s.image_rate_hz, kComment);
  const std::string size = s.width > 0 ? fmt::format("resolution: [{}, {}]\n", s.width, s.height) : "";
  return uncalibrated("calibration", "camera", s.image_rate_hz) + size;
}

std::string imu_text(const RecordedSensors& s) {
  if (s.imu) return asl_imu(*s.imu);
  return uncalibrated("noise densities", "imu", s.reading_rate_hz);
}

/// The old file stays until the new one is whole.
Status replace(Disk& disk, const fs::path& path, const std::string& text) {
  const fs::path made = path.string() + ".new";
  std::error_code ignored;
  fs::remove(made, ignored);
  if (const int error = write_new_file(disk, made, text); error != 0) return cannot_be_written(path, error);
  std::error_code failed;
  fs::rename(made, path, failed);
  if (failed) return cannot_be_written(path, failed.value());
  return Done{};
}

}  // namespace

Result<std::unique_ptr<RecordingFiles>> RecordingFiles::create(const fs::path& folder, Disk& disk,
                                                               std::size_t cameras) {
  const fs::path root = folder / "mav0";
  std::error_code ignored;
  if (fs::exists(root, ignored)) {
    return Error{ErrorKind::kUsage, root.string(), 0, "exists already",
                 "a folder without a recording: --out another one, or remove this one"};
  }
  for (std::size_t i = 0; i < cameras; ++i)
    if (const Status s = make_folder(root / fmt::format("cam{}", i) / "data"); !s) return s.error();
  if (const Status s = make_folder(root / "imu0"); !s) return s.error();
  std::unique_ptr<RecordingFiles> files(new RecordingFiles(root, disk, cameras));
  for (Images& images : files->images_) images.list.append(kAslImagesHeader);
  files->readings_.append(kAslImuHeader);
  if (const Status s = files->fault(); !s) return s.error();
  return files;
}

RecordingFiles::RecordingFiles(fs::path root, Disk& disk, std::size_t cameras)
    : root_(std::move(root)), disk_(disk), readings_(disk, root_ / "imu0/data.csv") {
  for (std::size_t i = 0; i < cameras; ++i) images_.emplace_back(disk, root_ / fmt::format("cam{}", i));
}

RecordingFiles::~RecordingFiles() {
  (void)settle();  // whichever way it ended
  std::error_code ignored;
  if (is_empty_) fs::remove_all(root_, ignored);
}

std::uint64_t RecordingFiles::bytes() const {
  std::uint64_t sum = image_bytes_ + readings_.bytes();
  for (const Images& images : images_) sum += images.list.bytes();
  return sum;
}

Status RecordingFiles::add_image(std::size_t camera, HostStamp stamp, const std::string& png) {
  Images& images = images_[camera];
  const std::string file = std::to_string(stamp.ns) + ".png";
  const fs::path path = images.folder / "data" / file;
  if (const int error = write_new_file(disk_, path, png); error != 0) return cannot_be_written(path, error);
  append_asl_image(images.unlisted, stamp, file);
  image_bytes_ += png.size();
  is_empty_ = false;
  return settle(stamp);
}

Status RecordingFiles::settle(HostStamp now) {
  constexpr Span kEvery = Span::from_milliseconds(1'000);
  if (settled_.ns == 0) settled_ = now;
  if (now - settled_ < kEvery) return Done{};
  settled_ = now;
  return settle();
}

Status RecordingFiles::settle() {
  disk_.sync(root_);
  for (Images& images : images_) {
    if (images.unlisted.empty()) continue;
    images.list.append(images.unlisted);
    images.list.sync();  // else the list would wait for the next round, a second more
    images.unlisted.clear();
  }
  return fault();
}

Status RecordingFiles::add_readings(std::span<const ImuSample> readings) {
  lines_.clear();
  for (const ImuSample& reading : readings) append_asl_imu(lines_, reading);
  if (!readings_.append(lines_)) return cannot_be_written(root_ / "imu0/data.csv", readings_.failure());
  is_empty_ = is_empty_ && readings.empty();
  return readings.empty() ? Status(Done{}) : settle(readings.back().stamp);
}

Status RecordingFiles::describe(const RecordedSensors& sensors) const {
  for (std::size_t i = 0; i < images_.size(); ++i) {
    if (const Status s = replace(disk_, images_[i].folder / "sensor.yaml", camera_text(sensors, sensors.cameras[i]));
        !s)
      return s.error();
  }
  return replace(disk_, root_ / "imu0/sensor.yaml", imu_text(sensors));
}

Status RecordingFiles::close() {
  if (const Status s = settle(); !s) return s;
  for (Images& images : images_) images.list.sync();
  readings_.sync();
  return fault();
}

Status RecordingFiles::fault() const {
  for (const Images& images : images_)
    if (const int error = images.list.failure(); error != 0)
      return cannot_be_written(images.folder / "data.csv", error);
  if (const int error = readings_.failure(); error != 0) return cannot_be_written(root_ / "imu0/data.csv", error);
  return Done{};
}

}  // namespace epiline
