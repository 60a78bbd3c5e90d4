#include "pipeline/realtime/realtime_pipeline.h"

#include <system_error>

#include "pipeline/realtime/flight_log.h"
#include "pipeline/realtime/log_stage.h"
#include "pipeline/realtime/stage_thread.h"
#include "pipeline/stages/capture_stage.h"
#include "pipeline/stages/estimate_stage.h"
#include "pipeline/stages/imu_stage.h"
#include "pipeline/stages/publish_stage.h"
#include "pipeline/stages/side_stage.h"
#include "pipeline/stages/track_stage.h"

namespace epiline {

namespace {
// The estimator was seen to use 87 KiB, the others 23 KiB (x86-64 with AVX-512, factors track and epipolar).
constexpr std::size_t kEstimateStack = 256 * 1024, kStack = 128 * 1024;

TrackStageSettings track_settings(const RealtimeSettings& s) {
  return {s.camera,
          s.tracker,
          mount_of(s.estimator),
          s.images,
          s.recorded,
          Span::from_seconds(1e-3 * s.realtime.imu_wait_ms),
          lenses_of(s.others, s.estimator)};
}

EstimateStageSettings estimate_settings(const RealtimeSettings& s) {
  return {s.estimator, s.deadline_ms, s.realtime.deadline_ms, Span::from_seconds(1e-3 * s.realtime.imu_wait_ms)};
}

ImuLimits limits_of(const EstimatorConfig& e) {
  return {e.saturation_gyroscope_rad_s, e.saturation_accelerometer_m_s2};
}
}  // namespace

/// The threads, what lies between them, and the stages that they carry.
struct RealtimePipeline::Impl {
  using Speaker = FlightLog::Speaker;

  Impl(const RealtimeSettings& settings, const RealtimePorts& ports);

  /// Calls `f(thread, stage)` for each.
  template <class F>
  void each(F&& f) {
    f(imu_thread, imu);
    f(capture_thread, capture);
    f(track_thread, track);
    f(estimate_thread, estimate);
    f(publish_thread, publish);
    f(log_thread, log);
    if (has_wheel) f(wheel_thread, wheel);
    if (has_height) f(height_thread, height);
  }
  std::vector<ImuStage::Reader> imu_readers() {
    std::vector<ImuStage::Reader> readers;
    if (settings.images) readers.push_back({&imu_to_track, &track_thread.parking()});
    readers.push_back({&imu_to_estimate, &estimate_thread.parking()});
    readers.push_back({&imu_to_publish, &publish_thread.parking()});
    return readers;
  }

  RealtimeSettings settings;
  bool has_wheel, has_height;
  Pace pace;
  FlightClock clock{{monotonic_ns, thread_cpu_ns}, &pace};
  std::string memory_not_locked;

  FlightSwitch flight;
  StageThread imu_thread, capture_thread, track_thread, estimate_thread, publish_thread, log_thread, wheel_thread,
      height_thread;

  LentImages images;
  FrameRing frames;
  ImuRing imu_to_track, imu_to_estimate, imu_to_publish;
  WheelRing wheel_to_estimate;
  HeightRing height_to_estimate;
  TrackedRing tracked;
  KnowledgeRing knowledge;
  LatestValue<Estimate> newest;
  Heard imu_heard, camera_heard;
  FlightLog flight_log;

  ImuStage imu;
  CaptureStage capture;
  EstimateStage estimate;
  TrackStage track;
  PublishStage publish;
  LogStage log;
  SideStage<WheelSample> wheel;
  SideStage<HeightSample> height;
};

RealtimePipeline::Impl::Impl(const RealtimeSettings& s, const RealtimePorts& p)
    : settings(s),
      has_wheel(p.wheel != nullptr),
      has_height(p.height != nullptr),
      imu_thread(settings_of(FlightThread::kImu, s.realtime, kStack), flight),
      capture_thread(settings_of(FlightThread::kCapture, s.realtime, kStack), flight),
      track_thread(settings_of(FlightThread::kTrack, s.realtime, kStack), flight),
      estimate_thread(settings_of(FlightThread::kEstimate, s.realtime, kEstimateStack), flight),
      publish_thread(settings_of(FlightThread::kPublish, s.realtime, kStack), flight),
      // what the others hand over before they end is still logged
      log_thread({"log", 0, -1, kStack}, flight, StageThread::AtStop::kGoOn),
      // without priority: the stamps are the kernel's, and nobody waits for them
      wheel_thread({"wheel", 0, -1, kStack}, flight),
      height_thread({"height", 0, -1, kStack}, flight),
      images(p.camera),
      flight_log(p.observers, p.event_rings, s.images_to_log),
      imu(p.imu, limits_of(s.estimator), s.imu_correction, clock,
          {imu_readers(), imu_heard, flight_log.events_of(Speaker::kImu), &flight_log.imu()}),
      capture(p.camera, clock,
              {frames, images, track_thread.parking(), camera_heard, flight_log.events_of(Speaker::kCapture)},
              apart_of(s.estimator)),
      estimate(
          estimate_settings(s), clock,
          {tracked, track_thread.ended(), imu_to_estimate, imu_thread.ended(), wheel_to_estimate, height_to_estimate},
          {knowledge, track_thread.parking(), flight_log.events_of(Speaker::kEstimate), &newest,
           &publish_thread.parking(),
           EstimateStage::Log{flight_log.outcomes(), flight_log.tracks(), log_thread.parking()}}),
      track(track_settings(settings), estimate.knowledge(), clock,
            {frames, images, capture_thread.ended(), imu_to_track, imu_thread.ended(), knowledge},
            {tracked, estimate_thread.parking(), flight_log.events_of(Speaker::kTrack), &flight_log.images()}),
      publish(s.estimator, s.realtime.deadline_ms, clock,
              {newest, estimate_thread.ended(), imu_to_publish, camera_heard, capture_thread.ended(), imu_heard,
               imu_thread.ended()},
              {p.odometry, flight_log.publications(), log_thread.parking()}),
      log(clock, {flight_log,
                  images,
                  {&track_thread.ended(), &estimate_thread.ended(), &publish_thread.ended()},
                  {{{RingName::kImuToTrack, &imu_to_track},
                    {RingName::kImuToEstimate, &imu_to_estimate},
                    {RingName::kImuToPublish, &imu_to_publish}}},
                  wheel_to_estimate,
                  height_to_estimate}),
      wheel(EventSource::kWheel, {p.wheel, imu_thread.ended(), capture_thread.ended()}, clock,
            {wheel_to_estimate, flight_log.events_of(Speaker::kWheel), flight_log.wheel()}),
      height(EventSource::kHeight, {p.height, imu_thread.ended(), capture_thread.ended()}, clock,
             {height_to_estimate, flight_log.events_of(Speaker::kHeight), flight_log.height()}) {}

RealtimePipeline::RealtimePipeline(const RealtimeSettings& settings, const RealtimePorts& ports)
    : impl_(std::make_unique<Impl>(settings, ports)) {
  bool all_started = true;
  impl_->each([&](StageThread& thread, Stage& stage) { all_started = all_started && thread.start(stage); });
  if (!all_started) {
    stop();
    join();
    throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "no thread left");
  }
  // here, not in arm(): on a busy machine this takes seconds, and the caller of arm() has just set the samples' clock
  impl_->memory_not_locked = settings.realtime.lock_memory ? lock_memory() : "not asked for";
}

RealtimePipeline::~RealtimePipeline() {
  stop();
  join();
}

void RealtimePipeline::arm(const Pace& pace) {
  impl_->pace = pace;
  impl_->flight.arm();
}

bool RealtimePipeline::finished() const noexcept {
  return impl_->log_thread.ended().is_set() || impl_->flight.stopped();
}

std::uint64_t RealtimePipeline::frames_out() const noexcept { return impl_->estimate.images(); }

RealtimePipeline::Progress RealtimePipeline::progress() const noexcept {
  const Impl& m = *impl_;
  const std::uint64_t refused = m.capture.refused();  // first: it never runs ahead of the images
  return {m.capture.images() - refused, m.estimate.images(), m.publish.counts().published.get(), m.imu.readings()};
}

void RealtimePipeline::stop() noexcept { impl_->flight.stop(); }

void RealtimePipeline::join() noexcept {
  impl_->each([](StageThread& thread, Stage&) { thread.join(); });
  impl_->track.give_back_all();
}

RealtimeReport RealtimePipeline::report() const {
  Impl& m = *impl_;
  RealtimeReport r;
  m.each([&](const StageThread& thread, const Stage&) {
    const ThreadSettings& s = thread.settings();
    const RealtimeThread& t = thread.thread();
    r.threads.push_back({s.name, s.priority, t.shortfall(), thread.costs(), t.stack_bytes(), t.stack_used()});
  });
  const auto ring = [&](const char* name, const auto& of) {
    r.rings.push_back({name, of.capacity(), of.high_water(), of.popped(), of.dropped()});
  };
  r.frames_overtaken = m.frames.evicted() + m.frames.overtaken();
  r.rings.push_back({"frames", m.frames.capacity(), m.frames.high_water(), m.frames.popped(), r.frames_overtaken});
  ring("imu_to_track", m.imu_to_track);
  ring("imu_to_estimate", m.imu_to_estimate);
  ring("imu_to_publish", m.imu_to_publish);
  if (m.has_wheel) ring(to_string(RingName::kWheelToEstimate), m.wheel_to_estimate);
  if (m.has_height) ring(to_string(RingName::kHeightToEstimate), m.height_to_estimate);
  ring("tracked", m.tracked);
  ring("knowledge", m.knowledge);
  m.flight_log.each_ring([&](RingName name, const auto& of) { ring(to_string(name), of); });
  r.events_dropped = m.flight_log.events_dropped();
  r.images_not_logged = m.flight_log.images_skipped();
  r.frames_in = m.capture.images();
  r.frames_refused = m.capture.refused();
  r.imu_watch = m.imu.watch();
  r.image_watch = m.capture.watch();
  r.frames_out = m.estimate.images();
  r.imu_in = m.imu.readings();
  r.wheel_in = m.wheel.samples();
  r.height_in = m.height.samples();
  r.imu_late = m.track.imu_late() + m.estimate.imu_late();
  const PublishStage::Counts& counts = m.publish.counts();
  r.published = counts.published.get();
  r.publish_failed = counts.publish_failed.get();
  r.late = counts.late.get();
  r.predicted = counts.predicted.get();
  r.predict_failed = counts.predict_failed.get();
  r.prediction = m.publish.prediction();
  r.prediction_latency = m.publish.prediction_latency();
  r.superseded = r.frames_out - r.published;
  r.load = m.estimate.back_end().load();
  r.memory_not_locked = m.memory_not_locked;
  return r;
}

const Estimator& RealtimePipeline::estimator() const noexcept { return impl_->estimate.back_end().estimator(); }

const TrackerStats* RealtimePipeline::tracker_stats() const noexcept { return impl_->track.tracker_stats(); }
const SecondStats* RealtimePipeline::other_stats(std::size_t camera) const noexcept {
  return impl_->track.other_stats(camera);
}

}  // namespace epiline
