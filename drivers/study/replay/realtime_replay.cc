#include <algorithm>
#include <csignal>
#include <system_error>

#include "drivers/flights/recordings/fault_injection.h"
#include "drivers/flights/recordings/flight_plan.h"
#include "drivers/flights/recordings/recorded_sensors.h"
#include "drivers/study/replay/inside.h"
#include "drivers/study/replay/recorded_run.h"
#include "drivers/study/report/page.h"
#include "estimator/geometry/so3.h"
#include "pipeline/realtime/realtime_pipeline.h"
#include "pipeline/recorder/flight_recorder.h"
#include "platform/linux/signals.h"
#include "platform/ports/ports.h"

namespace epiline {

namespace {

/// Collects outcomes and events without asking for memory.
class Collector final : public FlightObserver {
 public:
  explicit Collector(std::size_t images) : latency_ns_(images, kNone) {
    outcomes_.reserve(images);
    events_.reserve(kMostEvents);
  }
  void take(const FrameOutcome& outcome) noexcept override {
    if (outcomes_.size() < outcomes_.capacity()) outcomes_.push_back({outcome.serial, image_record(outcome)});
  }
  void published(std::uint64_t serial, std::int64_t latency_ns) noexcept override {
    if (serial < latency_ns_.size()) latency_ns_[serial] = latency_ns;
  }
  void event(const Event& event) noexcept override {
    if (events_.size() < kMostEvents) {
      events_.push_back(event);
    } else {
      ++events_lost_;
    }
  }
  void move_into(FlightRecord& record) {
    for (const Entry& entry : outcomes_) {
      record.images.push_back(entry.image);
      const std::int64_t ns = latency_ns_[entry.serial];
      if (ns != kNone) record.images.back().latency_ms = 1e-6 * static_cast<double>(ns);
    }
    record.events = std::move(events_);
    record.events_lost = events_lost_;
  }

 private:
  static constexpr std::int64_t kNone = std::numeric_limits<std::int64_t>::min();
  static constexpr std::size_t kMostEvents = 1 << 16;
  struct Entry {
    std::uint64_t serial = 0;
    ImageRecord image;
  };
  std::vector<Entry> outcomes_;
  std::vector<std::int64_t> latency_ns_;
  std::vector<Event> events_;
  std::uint64_t events_lost_ = 0;
};

/// Keeps the odometry of every IMU sample of a flight in memory, without heap calls or files during the flight.
class PredictedRecorder final : public OdometrySink {
 public:
  /// Keeps the odometry of the first `readings` samples. `next` gets all of it as well; may be null.
  PredictedRecorder(std::size_t readings, OdometrySink* next) : rows_(readings), next_(next) {}

  Status open() override { return Done{}; }
  void close() noexcept override {}
  bool publish(const Odometry& o) noexcept override {
    const bool room = count_ < rows_.size();
    if (room) rows_[count_++] = {o.stamp, o.p_WB_m, o.v_WB_m_s, o.omega_B_rad_s, o.q_WB, o.reset_counter};
    return (next_ == nullptr || next_->publish(o)) && room;
  }
  bool publish_image(const Odometry& odometry) noexcept override {
    return next_ == nullptr || next_->publish_image(odometry);
  }

  /// The path of the kept odometry, and how smooth it is.
  PredictedPath path() const {
    PredictedPath path;
    for (std::size_t i = 0; i < count_; ++i) {
      const Row& row = rows_[i];
      const Eigen::Quaterniond q(row.q[0], row.q[1], row.q[2], row.q[3]);
      path.trajectory.poses.push_back({row.stamp, vec3(row.p), q});
      if (i == 0 || rows_[i - 1].resets != row.resets) continue;
      const Row& before = rows_[i - 1];
      const Eigen::Quaterniond q_before(before.q[0], before.q[1], before.q[2], before.q[3]);
      const double dt = (row.stamp - before.stamp).seconds();
      const Vec3 step = vec3(row.p) - vec3(before.p) - 0.5 * dt * (vec3(row.v) + vec3(before.v));
      const Mat3 turn = so3_exp(0.5 * dt * (vec3(row.omega) + vec3(before.omega)));
      const Vec3 turned = so3_log(turn.transpose() * (q_before.conjugate() * q).toRotationMatrix());
      path.largest_jump_m = std::max(path.largest_jump_m, step.norm());
      path.largest_jump_rad = std::max(path.largest_jump_rad, turned.norm());
      path.largest_jump_m_s = std::max(path.largest_jump_m_s, (vec3(row.v) - vec3(before.v)).norm());
    }
    return path;
  }

 private:
  struct Row {
    HostStamp stamp;
    std::array<double, 3> p{}, v{}, omega{};
    std::array<double, 4> q{};
    std::uint32_t resets = 0;
  };
  std::vector<Row> rows_;  // written once at construction, so that no page fault comes later
  std::size_t count_ = 0;
  OdometrySink* next_;
};

RealtimeSettings settings_of(const AslDataset& dataset, const FlightPlan& plan, const Config& config) {
  return {dataset.camera.parameters,    config.tracker,       config.estimator,        dataset.imu.correction,
          config.deadline_ms,           config.realtime,      !dataset.images.empty(), recorded_points(dataset, plan),
          RecordedCamera::kImagesToLog, other_lenses(dataset)};
}

/// The instant of the computer's clock at which the recording begins: soon, with its first sample.
Pace pace_of(const AslDataset& dataset, const FlightPlan& plan, double speed) {
  constexpr std::int64_t kSoon_ns = 50'000'000;
  HostStamp first = plan.images.front().stamp;
  if (plan.first_imu < dataset.imu_samples.size()) first = std::min(first, dataset.imu_samples[plan.first_imu].stamp);
  return {first, monotonic_ns() + kSoon_ns, speed};
}

FlightObserver& start_view(FlightView& view, const AslDataset& dataset, const ReplayOptions& options) {
  const std::filesystem::path path = std::filesystem::absolute(options.dataset).lexically_normal();
  const std::string name = (path.has_filename() ? path : path.parent_path()).filename().string();
  if (!view.start({name, program_text(program_info()), dataset.camera.R_BC, !dataset.images.empty()})) {
    throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "cannot start a thread");
  }
  return view.observer();
}

double image_rate_hz(const FlightPlan& plan) {
  if (plan.images.size() < 2) return 20;
  return static_cast<double>(plan.images.size() - 1) / (plan.images.back().stamp - plan.images.front().stamp).seconds();
}

}  // namespace

Result<FlightRecord> replay_in_real_time(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                                         const ReplayOptions& options,
                                         const std::function<void(std::size_t, std::size_t)>& progress) {
  FlightRecord record = begin_record(dataset, plan, config, options);
  Collector collector(plan.images.size());
  RecordedCamera camera(dataset, plan);
  RecordedImu imu(dataset, plan);
  RecordedSamples<WheelSample> wheel(dataset.wheel_samples);
  RecordedSamples<HeightSample> height(dataset.height_samples);
  std::optional<PredictedRecorder> predicted;
  if (options.imu_rate) predicted.emplace(dataset.imu_samples.size() - plan.first_imu, options.odometry);
  try {
    const HostStamp first = plan.images.front().stamp;
    const CameraParameters& lens = dataset.camera.parameters;
    FaultyCamera faulty_camera(camera,
                               CameraFaults(options.faults, first, lens.width, lens.height, RecordedCamera::kBuffers));
    FaultyImu faulty_imu(imu, ImuFaults(options.faults, first));
    const EndSignals signals;  // before any thread begins
    RealtimePorts ports{&faulty_camera, &faulty_imu, predicted ? &*predicted : options.odometry, {&collector}, {}};
    if (!dataset.wheel_samples.empty()) ports.wheel = &wheel;
    if (!dataset.height_samples.empty()) ports.height = &height;
    if (options.observer != nullptr) ports.observers.push_back(options.observer);
    if (options.view != nullptr) ports.observers.push_back(&start_view(*options.view, dataset, options));
    std::optional<FlightRecorder> recorder;
    if (!config.recorder.folder.empty()) {
      recorder.emplace(config.recorder,
                       recorded_run(lens, other_lenses(dataset), image_rate_hz(plan), dataset.imu.correction, config));
      ports.observers.push_back(&*recorder);
      ports.event_rings.push_back(&recorder->events());
    }
    RealtimePipeline pipeline(settings_of(dataset, plan, config), ports);
    if (const Status s = camera.open(); !s) return s.error();
    const Pace pace = pace_of(dataset, plan, *options.realtime_speed);
    camera.start(pace);
    imu.start(pace);
    wheel.start(pace);
    height.start(pace);
    pipeline.arm(pace);
    for (bool goes_on = true; goes_on && !pipeline.finished();) {
      const int signal = signals.wait(Span::from_milliseconds(20));
      if (signal == SIGUSR1 && recorder) recorder->request();
      goes_on = !signals.ends(signal);  // what was done so far is a result
      progress(std::min<std::size_t>(pipeline.frames_out(), plan.images.size()), plan.images.size());
    }
    pipeline.stop();  // the IMU may have more than the images need
    pipeline.join();
    if (options.view != nullptr) options.view->finish();
    camera.close();
    progress(plan.images.size(), plan.images.size());
    if (camera.error()) return *camera.error();
    collector.move_into(record);
    take_report(pipeline, *options.realtime_speed, record);
    record.skipped["missed_by_camera"] = camera.missed();
    record.unreadable = camera.unreadable();
    record.skipped["unreadable"] = camera.unreadable().count();
    if (predicted) record.realtime->predicted = predicted->path();
    if (recorder) finish(*recorder, record);
  } catch (const std::system_error& e) {
    return Error{ErrorKind::kRun, options.dataset.string(), 0, e.what(),
                 "free threads and memory (ulimit -u, ulimit -l)"};
  }
  record.peak_rss_mib = peak_rss_mib();
  return record;
}

}  // namespace epiline
