#include "drivers/replay/replay.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>

#include "drivers/replay/asl_dataset.h"
#include "drivers/replay/image_file.h"
#include "pipeline/config/config.h"
#include "pipeline/report/report.h"
#include "pipeline/report/stats_json.h"
#include "pipeline/stages/offline.h"
#include "pipeline/text/table.h"
#include "platform/memory/allocation_count.h"

namespace epiline {

namespace {

std::int64_t steady_ns() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

double milliseconds(std::int64_t ns) { return 1e-6 * static_cast<double>(ns); }

std::uint64_t page_faults_of_this_thread() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return static_cast<std::uint64_t>(usage.ru_minflt + usage.ru_majflt);
}

double peak_rss_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

/// Defaults, then what the data set says, then the configuration file, then the command line.
void fill_config(const AslDataset& dataset, const ConfigFile* file, const ReplayOptions& options, Config& config) {
  EstimatorConfig& e = config.estimator;
  e.imu = dataset.imu.noise;
  if (dataset.imu.saturation_gyroscope_rad_s) e.saturation_gyroscope_rad_s = *dataset.imu.saturation_gyroscope_rad_s;
  if (dataset.imu.saturation_accelerometer_m_s2)
    e.saturation_accelerometer_m_s2 = *dataset.imu.saturation_accelerometer_m_s2;
  e.extrinsics = {dataset.camera.R_BC, dataset.camera.p_BC, Camera(dataset.camera.parameters).focal_px(),
                  dataset.camera.time_offset_s};
  if (file) file->apply(config);
  if (options.visual_factor) e.visual_factor = *options.visual_factor;
  if (options.deadline_ms) config.deadline_ms = *options.deadline_ms;
}

/// One flight on its way through the pipeline.
class Flight {
 public:
  Flight(const AslDataset& dataset, const Config& config, const ReplayOptions& options)
      : dataset_(dataset),
        pipeline_(settings(dataset, config)),
        shift_(Span::from_seconds(options.shift_images_ms * 1e-3)),
        counts_heap_(allocation_counting_available()) {
    record_.dataset_path = options.dataset.string();
    record_.dataset_images = dataset.instants_count();
    record_.dataset_imu_samples = dataset.imu_samples.size();
    record_.truth = dataset.ground_truth;
    record_.visual_factor = to_string(config.estimator.visual_factor);
    record_.keyframes = config.estimator.keyframes;
    if (!dataset.images.empty()) record_.max_features = config.tracker.max_features;
    if (config.deadline_ms > 0) record_.deadline_ms = config.deadline_ms;
    record_.skipped = {{"out_of_order", 0}, {"duplicate", 0}};
  }

  /// Chooses the images between the two times (seconds after the first) and the IMU samples from 1 s before.
  void select(double start_s, double duration_s) {
    HostStamp first = dataset_.instant(0), last = first;
    for (std::size_t i = 0; i < dataset_.instants_count(); ++i) {
      first = std::min(first, dataset_.instant(i));
      last = std::max(last, dataset_.instant(i));
    }
    record_.dataset_duration_s = (last - first).seconds();
    for (std::size_t i = 0; i < dataset_.instants_count(); ++i) {
      const double t = (dataset_.instant(i) - first).seconds();
      if (t >= start_s && t - start_s <= duration_s) chosen_.push_back(i);
    }
    const HostStamp imu_from = first + Span::from_seconds(start_s - 1.0) + shift_;
    while (next_imu_ < dataset_.imu_samples.size() && dataset_.imu_samples[next_imu_].stamp < imu_from) ++next_imu_;
    record_.images.reserve(chosen_.size());
  }

  std::size_t size() const { return chosen_.size(); }

  Status step(std::size_t k) {
    const std::size_t i = chosen_[k];
    const HostStamp stamp = dataset_.instant(i) + shift_;
    ++record_.images_read;
    if (!record_.images.empty() && stamp <= record_.images.back().stamp) {
      ++record_.skipped[stamp == record_.images.back().stamp ? "duplicate" : "out_of_order"];
      return Done{};
    }
    Frame frame;
    if (!dataset_.images.empty()) {
      const auto image = decoder_.read(i, dataset_);
      if (!image) return image.error();
      frame = *image;
      frame.stamp = stamp;
    }
    feed_imu(stamp);
    const std::uint64_t faults = page_faults_of_this_thread();
    const HeapCallScope heap;
    const OfflineStep step = dataset_.images.empty() ? step_tracks(i, stamp) : pipeline_.step(frame);
    heap_calls_ += heap.calls();
    record_.page_faults += page_faults_of_this_thread() - faults;
    keep(stamp, step);
    return Done{};
  }

  FlightRecord finish() {
    record_.estimator = pipeline_.estimator().stats();
    if (const TrackerStats* tracker = pipeline_.tracker_stats()) record_.tracker = *tracker;
    record_.skipped["refused_by_estimator"] = record_.estimator.frames_refused;
    if (counts_heap_) record_.heap_calls = heap_calls_;
    record_.peak_rss_mib = peak_rss_mib();
    return std::move(record_);
  }

 private:
  static OfflineSettings settings(const AslDataset& dataset, const Config& config) {
    return {dataset.camera.parameters, config.tracker,          config.estimator,
            config.deadline_ms,        !dataset.images.empty(), steady_ns};
  }

  /// In the file's order, up to and including the first sample that reaches the time needed.
  void feed_imu(HostStamp image) {
    const HostStamp needed = pipeline_.imu_needed_until(image);
    while (next_imu_ < dataset_.imu_samples.size() && (record_.imu_read == 0 || last_imu_ < needed)) {
      const ImuSample& sample = dataset_.imu_samples[next_imu_++];
      pipeline_.add_imu(sample);
      ++record_.imu_read;
      last_imu_ = sample.stamp;
    }
  }

  OfflineStep step_tracks(std::size_t i, HostStamp stamp) {
    const TrackInstant& instant = dataset_.instants[i];
    return pipeline_.step(stamp, dataset_.points.data() + instant.first, instant.count);
  }

  void keep(HostStamp stamp, const OfflineStep& step) {
    ImageRecord image;
    image.stamp = stamp;
    image.has_pose = step.result.has_pose;
    image.solved = step.result.solved;
    image.keyframe = step.result.keyframe;
    const Odometry& odometry = pipeline_.estimator().odometry();
    if (image.has_pose) set_odometry(image, odometry);
    image.health = odometry.health;
    const auto& features = pipeline_.tracked().features;
    image.tracks = static_cast<int>(features.size());
    image.new_tracks = static_cast<int>(
        std::count_if(features.begin(), features.end(), [](const TrackedFeature& f) { return f.age == 0; }));
    image.track_ms = milliseconds(step.track_ns);
    image.solve_ms = milliseconds(step.estimate.solve_ns);
    image.marginalise_ms = milliseconds(step.estimate.marginalise_ns);
    image.estimate_ms = milliseconds(step.estimate.estimate_ns);
    record_.images.push_back(image);
  }

  const AslDataset& dataset_;
  OfflinePipeline pipeline_;
  ImageDecoder decoder_;
  Span shift_;
  bool counts_heap_;
  std::vector<std::size_t> chosen_;
  std::size_t next_imu_ = 0;
  HostStamp last_imu_;
  std::uint64_t heap_calls_ = 0;
  FlightRecord record_;
};

}  // namespace

Result<ReplayResult> replay(const ReplayOptions& options,
                            const std::function<void(std::size_t, std::size_t)>& progress) {
  Config config;
  std::optional<ConfigFile> file;
  if (!options.config_file.empty()) {
    auto read = ConfigFile::read(options.config_file);
    if (!read) return read.error();
    file = std::move(*read);
    file->apply(config);  // for the names of calibration files; what the data set says comes before the rest
  }
  const auto dataset = is_bag(options.dataset) ? open_bag_dataset(options.dataset, options.topics, options.camera,
                                                                  config.camera_calibration, config.imu_calibration)
                                               : open_asl_dataset(options.dataset, options.camera,
                                                                  config.camera_calibration, config.imu_calibration);
  if (!dataset) return dataset.error();
  fill_config(*dataset, file ? &*file : nullptr, options, config);
  try {
    Flight flight(*dataset, config, options);
    flight.select(options.start_s, options.duration_s);
    if (flight.size() == 0) {
      return Error{ErrorKind::kUsage, options.dataset.string(), 0, "no image in the time asked for",
                   "a shorter --start or a longer --duration"};
    }
    for (std::size_t k = 0; k < flight.size(); ++k) {
      if (const Status status = flight.step(k); !status) return status.error();
      progress(k + 1, flight.size());
    }
    return ReplayResult{flight.finish(), dataset->notes};
  } catch (const std::invalid_argument& e) {
    return Error{ErrorKind::kUsage, options.config_file.string(), 0, e.what(), "settings that go together"};
  }
}

Result<std::optional<TrajectoryErrors>> write_outputs(const FlightRecord& record, const std::filesystem::path& folder) {
  if (const Status s = make_folder(folder); !s) return s.error();
  const std::optional<TrajectoryErrors> errors = errors_of(record);
  const ProgramInfo program = program_info();
  const Json stats = stats_json(record, errors, program);
  if (const Status s = write_text(folder / "trajectory.tum", tum_text(trajectory_of(record))); !s) return s.error();
  if (const Status s = write_text(folder / "stats.json", stats.dump(2) + "\n"); !s) return s.error();
  if (const Status s = write_text(folder / "report.html", report_html(record, errors, program)); !s) return s.error();
  return errors;
}

}  // namespace epiline
