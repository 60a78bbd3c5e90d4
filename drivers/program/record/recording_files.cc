#include "drivers/program/record/recording_files.h"

#include <fmt/format.h>

#include <utility>

#include "pipeline/config/asl.h"
#include "pipeline/text/table.h"
#include "pipeline/text/text.h"

namespace epiline {
namespace fs = std::filesystem;

namespace {

std::string camera_text(const RecordedSensors& s) {
  if (s.camera) return asl_camera(*s.camera, s.image_rate_hz, s.comment);
  Text out;
  out.print("# not calibrated: put the calibration in place of this file\n");
  out.print("sensor_type: camera\ncomment: \"{}\"\nrate_hz: {:.6g}\n", s.comment, s.image_rate_hz);
  if (s.width > 0) out.print("resolution: [{}, {}]\n", s.width, s.height);
  return out;
}

std::string imu_text(const RecordedSensors& s) {
  if (s.imu) return asl_imu(*s.imu);
  Text out;
  out.print("# not calibrated: put the noise densities in place of this file\n");
  out.print("sensor_type: imu\ncomment: \"{}\"\nrate_hz: {:.6g}\n", s.comment, s.reading_rate_hz);
  return out;
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

Result<std::unique_ptr<RecordingFiles>> RecordingFiles::create(const fs::path& folder, Disk& disk) {
  const fs::path root = folder / "mav0";
  std::error_code ignored;
  if (fs::exists(root, ignored)) {
    return Error{ErrorKind::kUsage, root.string(), 0, "exists already",
                 "a folder without a recording: --out another one, or remove this one"};
  }
  for (const char* part : {"cam0/data", "imu0"}) {
    if (const Status s = make_folder(root / part); !s) return s.error();
  }
  std::unique_ptr<RecordingFiles> files(new RecordingFiles(root, disk));
  files->images_.append(kAslImagesHeader);
  files->readings_.append(kAslImuHeader);
  if (const int error = files->images_.failure(); error != 0) return cannot_be_written(root / "cam0/data.csv", error);
  if (const int error = files->readings_.failure(); error != 0) return cannot_be_written(root / "imu0/data.csv", error);
  return files;
}

RecordingFiles::RecordingFiles(fs::path root, Disk& disk)
    : root_(std::move(root)),
      disk_(disk),
      images_(disk, root_ / "cam0/data.csv"),
      readings_(disk, root_ / "imu0/data.csv") {}

RecordingFiles::~RecordingFiles() {
  std::error_code ignored;
  if (is_empty_) fs::remove_all(root_, ignored);
}

Status RecordingFiles::add_image(HostStamp stamp, const std::string& png) {
  const std::string file = std::to_string(stamp.ns) + ".png";
  const fs::path path = root_ / "cam0/data" / file;
  if (const int error = write_new_file(disk_, path, png); error != 0) return cannot_be_written(path, error);
  lines_.clear();
  append_asl_image(lines_, stamp, file);
  if (!images_.append(lines_)) {
    std::error_code ignored;
    fs::remove(path, ignored);
    return cannot_be_written(root_ / "cam0/data.csv", images_.failure());
  }
  image_bytes_ += png.size();
  is_empty_ = false;
  return Done{};
}

Status RecordingFiles::add_readings(std::span<const ImuSample> readings) {
  lines_.clear();
  for (const ImuSample& reading : readings) append_asl_imu(lines_, reading);
  if (!readings_.append(lines_)) return cannot_be_written(root_ / "imu0/data.csv", readings_.failure());
  is_empty_ = is_empty_ && readings.empty();
  return Done{};
}

Status RecordingFiles::describe(const RecordedSensors& sensors) const {
  if (const Status s = replace(disk_, root_ / "cam0/sensor.yaml", camera_text(sensors)); !s) return s.error();
  return replace(disk_, root_ / "imu0/sensor.yaml", imu_text(sensors));
}

Status RecordingFiles::close() {
  images_.sync();
  readings_.sync();
  if (const int error = images_.failure(); error != 0) return cannot_be_written(root_ / "cam0/data.csv", error);
  if (const int error = readings_.failure(); error != 0) return cannot_be_written(root_ / "imu0/data.csv", error);
  return Done{};
}

}  // namespace epiline
