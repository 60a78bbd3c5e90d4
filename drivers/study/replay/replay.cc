#include "drivers/study/replay/replay.h"

#include <fmt/format.h>

#include <memory>
#include <stdexcept>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/flights/recordings/image_file.h"
#include "drivers/flights/recordings/loop.h"
#include "drivers/flights/recordings/mask_file.h"
#include "drivers/flights/recordings/recorded_sensors.h"
#include "drivers/study/replay/inside.h"
#include "pipeline/config/vehicle.h"
#include "pipeline/stages/imu_feed.h"
#include "pipeline/stages/offline.h"
#include "pipeline/text/table.h"
#include "platform/linux/end_request.h"
#include "platform/linux/realtime.h"
#include "platform/memory/allocation_count.h"
#include "platform/time/monotonic.h"

namespace epiline {

FlightRecord begin_record(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                          const ReplayOptions& options) {
  FlightRecord record;
  record.dataset_path = options.dataset.string();
  record.dataset_duration_s = plan.duration_s;
  record.dataset_images = dataset.instants_count();
  record.dataset_imu_samples = dataset.imu_samples.size();
  record.truth = dataset.ground_truth;
  record.visual_factor = config.estimator.visual_factor.name;
  record.keyframes = config.estimator.keyframes;
  if (!dataset.images.empty()) record.max_features = config.tracker.max_features;
  if (config.deadline_ms > 0) record.deadline_ms = config.deadline_ms;
  record.images_read = plan.chosen;
  record.skipped = plan.skipped;
  record.images.reserve(plan.images.size());
  return record;
}

std::vector<std::span<const TrackPoint>> recorded_points(const AslDataset& dataset, const FlightPlan& plan) {
  std::vector<std::span<const TrackPoint>> points;
  if (!dataset.images.empty()) return points;
  for (const PlannedImage& image : plan.images) {
    const TrackInstant& instant = dataset.instants[image.index];
    points.emplace_back(dataset.points.data() + instant.first, instant.count);
  }
  return points;
}

std::array<std::optional<CameraParameters>, kMostOthers> other_lenses(const AslDataset& dataset) {
  std::array<std::optional<CameraParameters>, kMostOthers> lenses;
  for (std::size_t i = 0; i < dataset.others.size(); ++i) lenses[i] = dataset.others[i]->camera.parameters;
  return lenses;
}

namespace {

Result<AslDataset> open_dataset(const ReplayOptions& options, const Config& config) {
  const bool several = options.camera == kBothCameras || options.camera == kAllCameras;
  const std::string camera = several ? "cam0" : options.camera;
  if (!is_bag(options.dataset)) {
    auto dataset = open_asl_dataset(options.dataset, camera, config.camera_calibration, config.imu_calibration);
    if (!dataset || !several) return dataset;
    const std::size_t cameras = options.camera == kBothCameras ? 2 : count_cameras(options.dataset);
    for (std::size_t c = 1; c < cameras; ++c)
      if (const Status s = open_other_camera(*dataset, fmt::format("cam{}", c), config.camera_calibration); !s)
        return s.error();
    return dataset;
  }
  if (several)
    return Error{ErrorKind::kUsage, options.dataset.string(), 0,
                 fmt::format("--camera {} with a ROS bag", options.camera), "an ASL folder"};
  return open_bag_dataset(options.dataset, options.topics, camera, config.camera_calibration, config.imu_calibration);
}

/// Precedence: command line, configuration file, data set, defaults.
void fill_config(const AslDataset& dataset, const ConfigFile* file, const ReplayOptions& options, Config& config) {
  EstimatorConfig& e = config.estimator;
  set_calibration(dataset.imu, e);
  set_calibration(dataset.camera, e);
  for (std::size_t i = 0; i < dataset.others.size(); ++i) {
    const CameraCalibration& other = dataset.others[i]->camera;
    e.others[i] = {true, other.R_BC, other.p_BC, other.parameters.readout_s, 0};
  }
  if (file) file->apply(config);
  set_vehicle(config);
  if (options.deadline_ms) config.deadline_ms = *options.deadline_ms;
  if (!options.record_folder.empty()) config.recorder.folder = options.record_folder.string();
  config.recorder.images |= options.record_images;
  if (options.tune) options.tune(config);
}

Status read_masks(const AslDataset& dataset, Config& config) {
  if (const Status s = read_mask(0, dataset.camera.parameters, config); !s) return s;
  for (std::size_t i = 0; i < dataset.others.size(); ++i)
    if (const Status s = read_mask(i + 1, dataset.others[i]->camera.parameters, config); !s) return s;
  return Done{};
}

/// What an observer of a flight in one thread gets by way of rings.
struct ObservedRings {
  OutcomeRing outcomes;
  TracksLogRing tracks;
  Parking nobody;
};

/// One flight through the pipeline, in this thread.
class Flight {
 public:
  Flight(const AslDataset& dataset, const FlightPlan& plan, const Config& config, const ReplayOptions& options)
      : dataset_(dataset),
        plan_(plan),
        rings_(options.observer != nullptr ? std::make_unique<ObservedRings>() : nullptr),
        pipeline_(settings(dataset, plan, config, rings_.get())),
        counts_heap_(allocation_counting_available()),
        next_imu_(plan.first_imu),
        imu_faults_(options.faults, plan.images.front().stamp),
        camera_faults_(options.faults, plan.images.front().stamp, dataset.camera.parameters.width,
                       dataset.camera.parameters.height, ImageDecoder::kBuffers),
        record_(begin_record(dataset, plan, config, options)),
        odometry_(options.odometry),
        observer_(options.observer) {}

  /// Image `k` of the plan.
  Status step(std::size_t k) {
    const PlannedImage& planned = plan_.images[k];
    Frame frame;
    if (!dataset_.images.empty()) {
      const auto image = cameras_[0].read(planned.index, dataset_);
      if (!image) return image.error();
      if (image->data == nullptr) return Done{};
      frame = *image;
      frame.slot = 1 - cameras_[0].shown;
    }
    OtherFrames others;
    for (std::size_t c = 0; c < dataset_.others.size(); ++c) {
      if (!planned.others[c]) continue;
      const auto image = cameras_[1 + c].read(*planned.others[c], *dataset_.others[c]);
      if (!image) return image.error();
      if (image->data == nullptr) continue;
      others[c] = *image;
      others[c].stamp = planned.stamp + planned.later[c];
    }
    frame.sequence = k;
    frame.stamp = frame.arrival = planned.stamp;
    if (!camera_faults_.apply(frame)) return Done{};
    const Frame given = frame;
    if (!pipeline_.admit(frame)) {
      ++record_.skipped["refused_by_watch"];
      return Done{};
    }
    feed_imu(frame.stamp);
    feed_sides(frame.stamp);
    const ThreadCosts before = costs_of_this_thread();
    const HeapCallScope heap;
    pipeline_.step(frame, others, outcome_);
    if (!is_blind(frame.reasons)) cameras_[0].turn();
    for (std::size_t c = 0; c < dataset_.others.size(); ++c)
      if (others[c].data != nullptr) cameras_[1 + c].turn();
    heap_calls_ += heap.calls();
    record_.page_faults += (costs_of_this_thread() - before).page_faults;
    record_.images.push_back(image_record(outcome_));
    if (odometry_ != nullptr && outcome_.result.has_pose) odometry_->publish_image(outcome_.odometry);
    for (Event event; pipeline_.events().pop(event);) record_.events.push_back(event);
    if (observer_ != nullptr) show(given, others);
    return Done{};
  }

  FlightRecord finish() {
    record_.events_lost = pipeline_.events().dropped();
    record_.estimator = pipeline_.estimator().stats();
    record_.load = pipeline_.load();
    record_.imu_watch = pipeline_.imu_watch();
    record_.image_watch = pipeline_.image_watch();
    if (const TrackerStats* tracker = pipeline_.tracker_stats()) record_.tracker = *tracker;
    for (std::size_t c = 1; c <= kMostOthers; ++c)
      if (const SecondStats* other = pipeline_.other_stats(c)) record_.others[c - 1] = *other;
    record_.skipped["refused_by_estimator"] = record_.estimator.frames_refused;
    record_.skipped["unreadable"] = cameras_[0].decoder.unreadable().count();
    for (const CameraImages& camera : cameras_) record_.unreadable.add(camera.decoder.unreadable());
    if (counts_heap_) record_.heap_calls = heap_calls_;
    record_.peak_rss_mib = peak_rss_mib();
    return std::move(record_);
  }

 private:
  static OfflineSettings settings(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                                  ObservedRings* rings) {
    OfflineSettings s{dataset.camera.parameters,
                      config.tracker,
                      config.estimator,
                      dataset.imu.correction,
                      config.deadline_ms,
                      !dataset.images.empty(),
                      recorded_points(dataset, plan),
                      {monotonic_ns, thread_cpu_ns},
                      other_lenses(dataset)};
    if (rings != nullptr) s.log.emplace(EstimateStage::Log{rings->outcomes, rings->tracks, rings->nobody});
    return s;
  }

  /// `frame`: the image as the camera gave it.
  void show(const Frame& frame, const OtherFrames& others) {
    if (frame.data != nullptr && observer_->wants_images()) observer_->image(frame, others);
    for (; const FrameOutcome* outcome = rings_->outcomes.front(); rings_->outcomes.pop()) observer_->take(*outcome);
    for (; const LoggedTracks* tracks = rings_->tracks.front(); rings_->tracks.pop()) observer_->tracks(*tracks);
  }

  void feed_imu(HostStamp image) {
    const HostStamp needed = pipeline_.imu_needed_until(image);
    while (feed_.wants_more(needed)) {
      if (next_delivered_ == delivered_count_) {
        if (next_imu_ == dataset_.imu_samples.size()) return;
        delivered_count_ = imu_faults_.apply(arrived(dataset_.imu_samples[next_imu_++]), delivered_);
        next_delivered_ = 0;
        continue;
      }
      ImuSample& sample = delivered_[next_delivered_++];
      ++record_.imu_read;
      if (observer_ != nullptr) observer_->imu(sample);
      if (pipeline_.add_imu(sample)) feed_.took(sample);
    }
  }

  /// Delivers samples up to the image and one more, as a bus would have by the time the image is tracked.
  void feed_sides(HostStamp image) {
    const HostStamp needed = pipeline_.imu_needed_until(image);
    const auto feed = [&](const auto& samples, std::size_t& next, auto&& add) {
      while (next < samples.size() && (next == 0 || samples[next - 1].stamp < needed)) add(samples[next++]);
    };
    feed(dataset_.wheel_samples, next_wheel_, [&](const WheelSample& s) {
      pipeline_.add_wheel(s);
      if (observer_ != nullptr) observer_->wheel(s);
    });
    feed(dataset_.height_samples, next_height_, [&](const HeightSample& s) {
      pipeline_.add_height(s);
      if (observer_ != nullptr) observer_->height(s);
    });
  }

  const AslDataset& dataset_;
  const FlightPlan& plan_;
  std::unique_ptr<ObservedRings> rings_;  ///< with an observer only
  OfflinePipeline pipeline_;
  struct CameraImages {
    ImageDecoder decoder;
    int shown = 1;  ///< its buffer with the last image, which the tracker still needs
    Result<Frame> read(std::size_t index, const AslDataset& from) {
      return decoder.read(index, from, static_cast<std::size_t>(1 - shown));
    }
    void turn() { shown = 1 - shown; }
  };
  std::array<CameraImages, 1 + kMostOthers> cameras_;
  bool counts_heap_;
  std::size_t next_imu_, next_wheel_ = 0, next_height_ = 0;
  ImuFaults imu_faults_;
  CameraFaults camera_faults_;
  std::array<ImuSample, ImuFaults::kMost> delivered_;     ///< the samples that the last reading became ...
  std::size_t delivered_count_ = 0, next_delivered_ = 0;  ///< ... and how many of them have been used
  ImuFeed feed_;
  FrameOutcome outcome_;
  std::uint64_t heap_calls_ = 0;
  FlightRecord record_;
  OdometrySink* odometry_;
  FlightObserver* observer_;
};

Result<FlightRecord> replay_in_one_thread(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                                          const ReplayOptions& options,
                                          const std::function<void(std::size_t, std::size_t)>& progress) {
  Flight flight(dataset, plan, config, options);
  for (std::size_t k = 0; k < plan.images.size() && !EndRequest::is_made(); ++k) {
    if (const Status status = flight.step(k); !status) return status.error();
    progress(k + 1, plan.images.size());
  }
  return flight.finish();
}

/// Fails if no image could be read.
Status tell_unreadable(const FlightRecord& record, AslDataset& dataset) {
  for (const auto& [expected, kind] : record.unreadable.kinds()) {
    if (record.images.empty()) return kind.first;
    dataset.notes.push_back(
        fmt::format("{} of {} images left out, the first: {}", kind.count, record.images_read, kind.first.text()));
  }
  return Done{};
}

void perturb(int times, AslDataset& dataset, FlightPlan& plan) {
  const std::size_t out = std::min(static_cast<std::size_t>(times), plan.images.size());
  plan.images.erase(plan.images.begin(), plan.images.begin() + static_cast<std::ptrdiff_t>(out));
  plan.chosen -= out;
  for (ImuSample& sample : dataset.imu_samples)
    for (double& f : sample.specific_force_m_s2) f *= 1 + 1e-7 * times;
}

}  // namespace

Result<ReplayResult> replay(const ReplayOptions& options,
                            const std::function<void(std::size_t, std::size_t)>& progress) {
  Config config;
  std::optional<ConfigFile> file;
  if (!options.config_file.empty() || !options.set.empty()) {
    auto read = ConfigFile::read(options.config_file, options.set);
    if (!read) return read.error();
    file = std::move(*read);
    file->apply(config);  // for the names of calibration files; the data set's values come before the other settings
  }
  auto dataset = open_dataset(options, config);
  if (!dataset) return dataset.error();
  set_shutter(config.devices.camera, dataset->camera.parameters);
  for (const auto& other : dataset->others) set_shutter(config.devices.camera, other->camera.parameters);
  if (options.alter) options.alter(*dataset);
  fill_config(*dataset, file ? &*file : nullptr, options, config);
  if (const Status s = read_masks(*dataset, config); !s) return s.error();
  if (!dataset->others.empty() && config.estimator.track_noise != TrackNoiseModel::kDrift)
    dataset->notes.push_back(fmt::format(
        "the flight is estimated from cam0 alone, no other camera is used: the visual factor is {}; several cameras "
        "need track",
        config.estimator.visual_factor.name));
  if (options.loop_s) loop_flight(*dataset, *options.loop_s);
  try {
    FlightPlan plan = plan_flight(*dataset, options);
    for (std::size_t i = 0; i < kMostOthers; ++i) config.estimator.others[i].apart_s = plan.apart[i].seconds();
    perturb(options.perturb, *dataset, plan);
    if (plan.images.empty()) {
      return Error{ErrorKind::kUsage, options.dataset.string(), 0, "no image between --start and --duration",
                   "a shorter --start or a longer --duration"};
    }
    progress(0, plan.images.size());
    auto record = options.realtime_speed ? replay_in_real_time(*dataset, plan, config, options, progress)
                                         : replay_in_one_thread(*dataset, plan, config, options, progress);
    if (!record) return record.error();
    if (EndRequest::is_made()) record->images_read = record->images.size();
    if (const Status s = tell_unreadable(*record, *dataset); !s) return s.error();
    return ReplayResult{std::move(*record), dataset->notes};
  } catch (const std::invalid_argument& e) {
    return Error{ErrorKind::kUsage, options.config_file.string(), 0, e.what(),
                 "settings that are consistent with each other"};
  }
}

}  // namespace epiline
