#include "drivers/flights/recordings/asl_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/flights/recordings/image_file.h"
#include "pipeline/config/asl.h"
#include "pipeline/text/table.h"
#include "platform/math/statistics.h"

namespace epiline {

namespace fs = std::filesystem;

namespace {

Error missing(const fs::path& path, std::string expected) {
  return {ErrorKind::kUsage, path.string(), 0, "does not exist", std::move(expected)};
}

/// Well-known layouts of others, by something that is in the folder.
struct ForeignLayout {
  const char *file, *what;
};
constexpr ForeignLayout kForeignLayouts[] = {
    {"rgb.txt", "is a TUM RGB-D recording: there is no gyroscope"},
    {"image_0", "is a sequence of KITTI odometry: there is no IMU"},
    {"oxts", "is a KITTI raw recording, which is not read: its IMU has 10 Hz, or 100 Hz where it is unsynchronised"}};

const char* why_no_root(const fs::path& folder) {
  std::error_code ignored;
  for (const ForeignLayout& layout : kForeignLayouts)
    if (fs::exists(folder / layout.file, ignored)) return layout.what;
  return "no mav0/imu0 or imu0 inside";
}

Result<fs::path> find_root(const fs::path& folder) {
  constexpr const char* kExpected = "a data set: an ASL folder, or a bag (ROS 1, ROS 2, MCAP)";
  std::error_code ignored;
  if (!fs::exists(folder, ignored)) return missing(folder, kExpected);
  if (!fs::is_directory(folder, ignored))
    return Error{ErrorKind::kUsage, folder.string(), 0, "is not a folder", kExpected};
  fs::path root = fs::is_directory(folder / "mav0", ignored) ? folder / "mav0" : folder;
  if (!fs::is_directory(root / "imu0", ignored))
    return Error{ErrorKind::kUsage, folder.string(), 0, why_no_root(folder), kExpected};
  return root;
}

/// Where the image of that name is: in `data`, beside the list, or there with the ending left out. If nowhere, in
/// `data`.
fs::path image_path(const fs::path& folder, const std::string& name) {
  for (const char* ending : {"", ".png", ".jpg", ".jpeg", ".pgm"}) {
    for (const fs::path& place : {folder / "data", folder}) {
      fs::path path = place / (name + ending);
      std::error_code ignored;
      if (fs::is_regular_file(path, ignored)) return path;
    }
  }
  return folder / "data" / name;
}

Status read_image_list(AslDataset& d) {
  constexpr const char* kExpected = "time, image file";
  const std::string list = d.image_list.string();
  const auto text = read_text(d.image_list);
  if (!text) return text.error();
  TimeFields times;
  LineReader lines(*text);
  bool is_first = true;
  for (std::string_view line; lines.next(line); is_first = false) {
    if (is_first && is_header(line)) continue;
    std::string_view time, name;
    if (!take_field(line, time) || !take_field(line, name) || name.empty())
      return Error{ErrorKind::kUsage, list, lines.number(), "the line has no image file", kExpected};
    times.add(time, lines.number());
    d.images.push_back({{}, image_path(d.image_list.parent_path(), std::string(name)), lines.number()});
  }
  if (d.images.empty()) return Error{ErrorKind::kUsage, list, 0, "lists no image", kExpected};
  const auto ns = times.parse(TimeColumn::kSensor, list, d.notes);
  if (!ns) return ns.error();
  for (std::size_t i = 0; i < ns->size(); ++i) d.images[i].stamp = HostStamp{(*ns)[i]};
  const std::vector<ImageFile> as_listed = d.images;
  const std::vector<std::size_t> order = order_of_time(*ns, list, d.notes);
  for (std::size_t i = 0; i < order.size(); ++i) d.images[i] = as_listed[order[i]];
  d.image_source = image_files(d.images, d.image_list);
  return Done{};
}

/// A table of a sensor, with its remarks.
Result<NumberTable> read_table(const fs::path& path, TimeColumn time, std::size_t width, const char* what,
                               std::vector<std::string>& notes) {
  const auto text = read_text(path);
  if (!text) return text.error();
  auto table = parse_table(*text, path.string(), time, {width}, what);
  if (table) notes.insert(notes.end(), table->notes.begin(), table->notes.end());
  return table;
}

Status read_tracks(AslDataset& d) {
  const auto table = read_table(d.image_list, TimeColumn::kSensor, 4, "track point (time, id, u, v)", d.notes);
  if (!table) return table.error();
  for (std::size_t i = 0; i < table->rows(); ++i) {
    const double* row = table->row(i);
    const bool good_id =
        row[0] >= 0 && row[0] <= std::numeric_limits<std::uint32_t>::max() && row[0] == std::floor(row[0]);
    if (!good_id) {
      return Error{ErrorKind::kUsage, d.image_list.string(), 0, "a track id of " + std::to_string(row[0]),
                   "integers from 0 to 2^32-1"};
    }
    const HostStamp stamp{table->time_ns[i]};
    if (d.instants.empty() || d.instants.back().stamp != stamp) d.instants.push_back({stamp, d.points.size(), 0});
    if (!std::isfinite(row[1]) || !std::isfinite(row[2])) continue;  // a point that is none; its instant stays
    d.points.push_back({static_cast<std::uint32_t>(row[0]), static_cast<float>(row[1]), static_cast<float>(row[2])});
    ++d.instants.back().count;
  }
  if (d.instants.empty())
    return Error{ErrorKind::kUsage, d.image_list.string(), 0, "lists no track point", "time, id, u, v"};
  return Done{};
}

bool is_calibration(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored) && !holds_no_calibration(path);
}

/// Where a sensor's calibration is: the file asked for, the sensor's own, or the one TUM-VI puts beside `mav0` for all.
fs::path calibration_path(const fs::path& root, const fs::path& sensor, const char* shared, const fs::path& asked_for) {
  if (!asked_for.empty()) return asked_for;
  std::error_code ignored;
  const fs::path own = root / sensor / "sensor.yaml", beside = root / ".." / "dso" / shared;
  return !is_calibration(own) && fs::exists(beside, ignored) ? beside.lexically_normal() : own;
}

Status read_lens(AslDataset& d, const std::string& camera, const fs::path& calibration_file) {
  const fs::path calibration = calibration_path(d.root, camera, "camchain.yaml", calibration_file);
  std::error_code ignored;
  if (!fs::exists(calibration, ignored)) return missing(calibration, "the camera's calibration");
  if (holds_no_calibration(calibration)) {
    return Error{ErrorKind::kUsage, calibration.string(), 0, "holds no calibration",
                 "one in its place, or its file in camera.calibration; `epiline calibrate` finds it from a recording "
                 "of a board"};
  }
  const auto parameters = read_camera_calibration(calibration, camera);
  if (!parameters) return parameters.error();
  d.camera = *parameters;
  return Done{};
}

/// What the camera saw: images or tracks.
Status read_camera(AslDataset& d, const std::string& camera) {
  const fs::path folder = d.root / camera;
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) return missing(folder, "the folder of the camera");
  d.image_list = find_table(folder, "data.csv");
  if (!d.image_list.empty()) return read_image_list(d);
  d.image_list = find_table(folder, "tracks.csv");
  if (!d.image_list.empty()) return read_tracks(d);
  return missing(folder / "data.csv", "the list of images, or tracks.csv");
}

double median_length(const std::vector<ImuSample>& samples, std::array<double, 3> ImuSample::*sensor) {
  std::vector<double> lengths;
  for (const ImuSample& s : samples)
    if (const double length = vec3(s.*sensor).norm(); std::isfinite(length)) lengths.push_back(length);
  return lengths.empty() ? 0 : summarise(std::move(lengths)).median;
}

/// A minute's median of rates is never that of gravity, nor is a flight's acceleration a third of it.
Status check_columns(const AslMotion& d) {
  constexpr double kGravity = 9.81, kNear = 1.5;
  const double rate = median_length(d.imu_samples, &ImuSample::angular_velocity_rad_s),
               force = median_length(d.imu_samples, &ImuSample::specific_force_m_s2);
  if (std::abs(rate - kGravity) > kNear || force > kGravity / 3) return Done{};
  return Error{ErrorKind::kUsage, d.imu_file.string(), 0,
               fmt::format("columns 2 to 4 have the length {:.2f}, as accelerations have, and columns 5 to 7 {:.2f}",
                           rate, force),
               "time, 3 rates (rad/s), 3 accelerations (m/s^2), in this order"};
}

/// Images and readings of two clocks tell no motion.
Status check_common_time(const AslDataset& d) {
  const auto [first_imu, last_imu] = std::minmax_element(
      d.imu_samples.begin(), d.imu_samples.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
  const auto [first, last] = d.extent();
  if (!(last < first_imu->stamp) && !(last_imu->stamp < first)) return Done{};
  const auto seconds = [](HostStamp t) { return 1e-9 * static_cast<double>(t.ns); };
  return Error{ErrorKind::kUsage, d.image_list.string(), 0,
               fmt::format("images from {:.3f} to {:.3f} s, but IMU samples from {:.3f} to {:.3f} s", seconds(first),
                           seconds(last), seconds(first_imu->stamp), seconds(last_imu->stamp)),
               "times of one clock"};
}

Status read_imu(AslMotion& d, const fs::path& calibration_file) {
  const fs::path folder = d.root / "imu0";
  const fs::path calibration = calibration_path(d.root, "imu0", "imu_config.yaml", calibration_file);
  std::error_code ignored;
  if (calibration_file.empty() ? is_calibration(calibration) : fs::exists(calibration, ignored)) {
    const auto imu = read_imu_calibration(calibration);
    if (!imu) return imu.error();
    d.imu = *imu;
  } else if (!calibration_file.empty()) {
    return missing(calibration, "the IMU's calibration");
  } else {
    d.notes.push_back(calibration.string() +
                      (fs::exists(calibration, ignored) ? " holds no calibration" : " does not exist") +
                      ": assuming the noise densities of EuRoC's ADIS16448");
  }
  const fs::path path = find_table(folder, "data.csv");
  if (path.empty()) return missing(folder / "data.csv", "the IMU's samples");
  d.imu_file = path;
  const auto table = read_table(path, TimeColumn::kImu, 7, "IMU sample (time, 3 rates, 3 forces)", d.notes);
  if (!table) return table.error();
  if (table->rows() == 0)
    return Error{ErrorKind::kUsage, path.string(), 0, "lists no IMU sample", "time, 3 rates, 3 forces"};
  d.imu_samples.reserve(table->rows());
  for (std::size_t i = 0; i < table->rows(); ++i) {
    const double* r = table->row(i);
    d.imu_samples.push_back({HostStamp{table->time_ns[i]}, {r[0], r[1], r[2]}, {r[3], r[4], r[5]}});
  }
  return check_columns(d);
}

/// Calls `take` with the stamp and the value of each row of a sensor's table, if it has one.
template <class Take>
Status read_values(AslMotion& d, const char* sensor, const char* what, Take take) {
  const fs::path path = find_table(d.root / sensor, "data.csv");
  if (path.empty()) return Done{};
  const auto table = read_table(path, TimeColumn::kSensor, 2, what, d.notes);
  if (!table) return table.error();
  for (std::size_t i = 0; i < table->rows(); ++i) take(HostStamp{table->time_ns[i]}, table->row(i)[0]);
  return Done{};
}

Status read_wheel(AslMotion& d) {
  return read_values(d, "wheel0", "speed (time, m/s)", [&](HostStamp stamp, double speed) {
    d.wheel_samples.push_back({stamp, speed, std::numeric_limits<double>::quiet_NaN()});
  });
}

Status read_heights(AslMotion& d) {
  for (const AslHeightTable& kind : kAslHeightTables) {
    const auto add = [&](HostStamp stamp, double metres) { d.height_samples.push_back({stamp, kind.kind, metres}); };
    if (const Status s = read_values(d, kind.folder, "height (time, m)", add); !s) return s;
  }
  std::stable_sort(d.height_samples.begin(), d.height_samples.end(),
                   [](const HeightSample& a, const HeightSample& b) { return a.stamp < b.stamp; });
  return Done{};
}

/// All but the ground truth.
Status read_motion(const fs::path& folder, const fs::path& imu_file, AslMotion& d) {
  const auto root = find_root(folder);
  if (!root) return root.error();
  d.root = *root;
  if (const Status s = read_imu(d, imu_file); !s) return s;
  if (const Status s = read_wheel(d); !s) return s;
  return read_heights(d);
}

/// Empty if there is none.
fs::path truth_file(const fs::path& root) {
  const fs::path path = find_table(root / "state_groundtruth_estimate0", "data.csv");
  return path.empty() ? find_table(root / "mocap0", "data.csv") : path;  // mocap0: TUM-VI
}

Status read_ground_truth(AslMotion& d) {
  d.truth_file = truth_file(d.root);
  if (d.truth_file.empty()) return Done{};
  auto truth = read_trajectory(d.truth_file);
  if (!truth) return truth.error();
  d.ground_truth = std::move(*truth);
  d.notes.insert(d.notes.end(), d.ground_truth->notes.begin(), d.ground_truth->notes.end());
  return Done{};
}

}  // namespace

std::pair<HostStamp, HostStamp> AslDataset::extent() const {
  HostStamp first = instant(0), last = first;
  for (std::size_t i = 0; i < instants_count(); ++i) {
    first = std::min(first, instant(i));
    last = std::max(last, instant(i));
  }
  return {first, last};
}

std::vector<ImuSample> corrected_samples(const AslMotion& motion) {
  std::vector<ImuSample> samples = motion.imu_samples;
  for (ImuSample& sample : samples) motion.imu.correction.apply(sample);
  return samples;
}

Result<AslMotion> open_asl_motion(const fs::path& folder, const fs::path& imu_file) {
  AslMotion d;
  if (const Status s = read_motion(folder, imu_file, d); !s) return s.error();
  if (const Status s = read_ground_truth(d); !s) return s.error();
  return d;
}

Result<AslDataset> open_asl_dataset(const fs::path& folder, const std::string& camera, const fs::path& camera_file,
                                    const fs::path& imu_file) {
  auto d = open_uncalibrated_asl_dataset(folder, camera, imu_file);
  if (!d) return d.error();
  if (const Status s = read_lens(*d, camera, camera_file); !s) return s.error();
  if (const Status s = check_common_time(*d); !s) return s.error();
  if (const Status s = read_ground_truth(*d); !s) return s.error();
  return d;
}

Status open_other_camera(AslDataset& dataset, const std::string& camera, const fs::path& camera_file) {
  const auto other = std::make_shared<AslDataset>();
  other->root = dataset.root;
  if (const Status s = read_camera(*other, camera); !s) return s.error();
  const bool in_chain = !camera_file.empty() && is_chain_with(camera_file, camera);
  if (const Status s = read_lens(*other, camera, in_chain ? camera_file : fs::path{}); !s) return s.error();
  for (const AslDataset* d : {static_cast<const AslDataset*>(&dataset), static_cast<const AslDataset*>(other.get())})
    if (d->images.empty())
      return Error{ErrorKind::kUsage, d->image_list.string(), 0, "holds tracks", "images of both cameras"};
  dataset.others.push_back(other);
  return Done{};
}

std::size_t count_cameras(const fs::path& folder) {
  const auto root = find_root(folder);
  std::size_t n = 0;
  while (root && n <= kMostOthers && fs::is_directory(*root / ("cam" + std::to_string(n)))) ++n;
  return n;
}

Result<AslDataset> open_uncalibrated_asl_dataset(const fs::path& folder, const std::string& camera,
                                                 const fs::path& imu_file) {
  AslDataset d;
  if (const Status s = read_motion(folder, imu_file, d); !s) return s.error();
  if (const Status s = read_camera(d, camera); !s) return s.error();
  return d;
}

}  // namespace epiline
