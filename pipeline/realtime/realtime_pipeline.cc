#include "pipeline/realtime/realtime_pipeline.h"

#include <system_error>

#include "pipeline/realtime/realtime_threads.h"

namespace epiline {

namespace {
// Used at most 58 KiB by the estimator and 23 KiB by the others, on x86-64: with every visual factor, with faults, a
// recorder and a view.
constexpr std::size_t kEstimateStack = 256 * 1024, kStack = 128 * 1024;
}  // namespace

RealtimePipeline::Impl::Impl(const RealtimeSettings& s, const RealtimePorts& p)
    : settings(s),
      ports(p),
      recorded(Camera(s.camera)),
      back_end(s.estimator, kThreadClocks, Span::from_seconds(1e-3 * s.deadline_ms).ns),
      flight_log(p.observers, p.event_rings, s.images_to_log),
      imu_gate({s.estimator.saturation_gyroscope_rad_s, s.estimator.saturation_accelerometer_m_s2}) {
  if (s.images) front_end.emplace(Camera(s.camera), s.tracker, s.estimator.extrinsics.R_BC);
  known = knowledge_of(back_end);
  const RealtimeConfig& r = s.realtime;
  const auto set_up = [&](Worker& w, const char* name, int priority, int cpu, std::size_t stack, void (Impl::*loop)()) {
    w.name = name;
    w.priority = priority;
    w.cpu = cpu;
    w.stack_bytes = stack;
    w.loop = loop;
    w.owner = this;
  };
  set_up(imu, "imu", r.priority_imu, r.cpu_imu, kStack, &Impl::imu_loop);
  set_up(capture, "capture", r.priority_capture, r.cpu_capture, kStack, &Impl::capture_loop);
  set_up(track, "track", r.priority_track, r.cpu_track, kStack, &Impl::track_loop);
  set_up(estimate, "estimate", r.priority_estimate, r.cpu_estimate, kEstimateStack, &Impl::estimate_loop);
  set_up(publish, "publish", r.priority_publish, r.cpu_publish, kStack, &Impl::publish_loop);
  set_up(log, "log", 0, -1, kStack, &Impl::log_loop);
  set_up(wheel, "wheel", 0, -1, kStack,
         &Impl::wheel_loop);  // its stamps are the kernel's, and nobody waits for it
}

void RealtimePipeline::Impl::start(Worker& worker) {
  if (!worker.thread.start({worker.name, worker.priority, worker.cpu, worker.stack_bytes}, run, &worker)) {
    throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "no thread left");
  }
}

void RealtimePipeline::Impl::run(void* context) {
  Worker& worker = *static_cast<Worker*>(context);
  Impl& m = *worker.owner;
  const auto released = [&] { return m.armed.load(std::memory_order_acquire); };
  while (!m.wait(worker, kPoll, released)) {
  }
  const ThreadCosts before = costs_of_this_thread();
  (m.*worker.loop)();
  worker.costs = costs_of_this_thread() - before;
}

/// The worker has handed over its last element.
void RealtimePipeline::Impl::end(Worker& worker, std::initializer_list<Worker*> readers) {
  // release, pairs with the acquire in has_ended(): who sees the end finds every element in the ring
  worker.ended.store(true, std::memory_order_release);
  for (Worker* reader : readers) reader->parking.notify();
}

RealtimePipeline::RealtimePipeline(const RealtimeSettings& settings, const RealtimePorts& ports)
    : impl_(std::make_unique<Impl>(settings, ports)) {
  try {
    impl_->each([&](Impl::Worker& worker) { impl_->start(worker); });
  } catch (const std::system_error&) {
    stop();
    join();
    throw;
  }
  // here, not in arm(): on a busy machine it takes seconds, and whoever calls arm() has just set the samples' clock
  impl_->memory_not_locked = settings.realtime.lock_memory ? lock_memory() : "not asked for";
}

RealtimePipeline::~RealtimePipeline() {
  stop();
  join();
}

void RealtimePipeline::arm(const Pace& pace) {
  Impl& m = *impl_;
  m.pace = pace;
  m.armed.store(true, std::memory_order_release);
  m.each([](Impl::Worker& worker) { worker.parking.notify(); });
}

bool RealtimePipeline::finished() const noexcept { return impl_->has_ended(impl_->log) || impl_->stopping(); }

std::uint64_t RealtimePipeline::frames_out() const noexcept {
  return impl_->frames_out.load(std::memory_order_relaxed);
}

RealtimePipeline::Progress RealtimePipeline::progress() const noexcept {
  const auto now = [](const std::atomic<std::uint64_t>& counter) { return counter.load(std::memory_order_relaxed); };
  const std::uint64_t refused = now(impl_->frames_refused);  // first: it never runs ahead of frames_in
  return {now(impl_->frames_in) - refused, now(impl_->frames_out), now(impl_->published), now(impl_->imu_in)};
}

void RealtimePipeline::stop() noexcept {
  impl_->stopped.store(true, std::memory_order_release);
  impl_->each([](Impl::Worker& worker) { worker.parking.notify(); });
}

void RealtimePipeline::join() noexcept {
  impl_->each([](Impl::Worker& worker) { worker.thread.join(); });
  impl_->give_back_rest();
}

RealtimeReport RealtimePipeline::report() const {
  Impl& m = *impl_;
  RealtimeReport r;
  m.each([&](const Impl::Worker& w) {
    r.threads.push_back(
        {w.name, w.priority, w.thread.shortfall(), w.costs, w.thread.stack_bytes(), w.thread.stack_used()});
  });
  const auto ring = [&](const char* name, const auto& of) {
    r.rings.push_back({name, of.capacity(), of.high_water(), of.popped(), of.dropped()});
  };
  r.frames_overtaken = m.frames.evicted() + m.frames.overtaken();
  r.rings.push_back({"frames", m.frames.capacity(), m.frames.high_water(), m.frames.popped(), r.frames_overtaken});
  ring("imu_to_track", m.imu_to_track);
  ring("imu_to_estimate", m.imu_to_estimate);
  ring("imu_to_publish", m.imu_to_publish);
  if (m.ports.wheel != nullptr) ring(to_string(RingName::kWheelToEstimate), m.wheel_to_estimate);
  ring("tracked", m.tracked);
  ring("knowledge", m.knowledge);
  m.flight_log.each_ring([&](RingName name, const auto& of) { ring(to_string(name), of); });
  r.events_dropped = m.flight_log.events_dropped();
  r.images_not_logged = m.flight_log.images_skipped();
  r.frames_in = m.frames_in.load();
  r.frames_refused = m.frames_refused.load();
  r.imu_watch = m.imu_gate.stats();
  r.image_watch = m.image_gate.stats();
  r.frames_out = m.frames_out.load();
  r.imu_in = m.imu_in.load();
  r.wheel_in = m.wheel_in.load();
  r.imu_late = m.track_imu_late.load() + m.estimate_imu_late.load();
  r.published = m.published.load();
  r.publish_failed = m.publish_failed.load();
  r.late = m.late.load();
  r.load = m.back_end.load();
  r.predicted = m.predicted.load();
  r.predict_failed = m.predict_failed.load();
  r.prediction = m.predictor.stats();
  r.prediction_latency = m.prediction_latency;
  r.superseded = r.frames_out - r.published;
  r.memory_not_locked = m.memory_not_locked;
  return r;
}

const Estimator& RealtimePipeline::estimator() const noexcept { return impl_->back_end.estimator(); }

const TrackerStats* RealtimePipeline::tracker_stats() const noexcept {
  return impl_->front_end ? &impl_->front_end->stats() : nullptr;
}

}  // namespace epiline
