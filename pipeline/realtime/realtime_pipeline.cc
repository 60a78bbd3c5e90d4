#include "pipeline/realtime/realtime_pipeline.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <system_error>

#include "pipeline/stages/imu_feed.h"
#include "pipeline/stages/track_stage.h"
#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/newest_ring.h"
#include "platform/concurrency/parking.h"
#include "platform/error/contract.h"

namespace epiline {

namespace {

constexpr Span kPoll = Span::from_milliseconds(100);  // how soon an idle thread looks around
constexpr std::size_t kImuRing = 4096;                // 20 s at 200 Hz, 4 s at 1 kHz
using ImuRing = SpscRing<ImuSample, kImuRing>;

/// What the estimator knows after an image, for the tracking of the next one.
struct Knowledge {
  std::array<double, 3> gyroscope_bias_rad_s{};
  double time_offset_s = 0;  ///< as handed out
  Span imu_after_image{};    ///< readings are needed up to the image's stamp and this
};

/// An image on its way from the tracker to the estimator.
struct Tracked {
  TrackedFrame frame;
  std::int64_t deadline_ns = 0, track_ns = 0;
};

/// The newest estimate, for the publisher.
struct Estimate {
  std::uint64_t serial = 0;  ///< from 1; 0: none yet
  bool has_pose = false;
  Odometry odometry;
};

struct Publication {
  std::uint64_t serial = 0;
  std::int64_t latency_ns = 0;
};

}  // namespace

struct RealtimePipeline::Impl {
  /// A thread, where it parks, and what it cost.
  struct Worker {
    const char* name = "";
    int priority = 0, cpu = -1;
    void (Impl::*loop)() = nullptr;
    Impl* owner = nullptr;
    Parking parking;
    std::atomic<bool> ended{false};
    ThreadCosts costs;
    RealtimeThread thread;
  };

  Impl(const RealtimeSettings& settings, const RealtimePorts& ports);

  void start(Worker& worker);
  static void run(void* worker);
  template <class F>
  void each(F&& f) {
    for (Worker* w : {&imu, &capture, &track, &estimate, &publish, &log}) f(*w);
  }

  void imu_loop();
  void capture_loop();
  void track_loop();
  void estimate_loop();
  void publish_loop();
  void log_loop();

  void track_frame(const Frame& frame);
  void learn();
  void estimate_frame(const Tracked& tracked);
  void publish_estimate(const Estimate& newest);
  std::int64_t deadline_of(HostStamp image, std::int64_t began_ns) const;
  template <class Stage>
  void take_imu(Worker& worker, ImuRing& ring, ImuFeed& feed, HostStamp needed, Stage& stage);
  template <class Stage>
  void relieve(ImuRing& ring, ImuFeed& feed, Stage& stage);
  void give_back(NewestRing<4>::Value slot) { ports.camera->give_back(slots[slot]); }

  bool stopping() const { return stopped.load(std::memory_order_acquire); }
  bool has_ended(const Worker& worker) const { return worker.ended.load(std::memory_order_acquire); }
  void end(Worker& worker, std::initializer_list<Worker*> readers);
  /// A lost device may say so at once: no real-time thread may ask it all the time.
  void rest_after_failure(Worker& worker) {
    wait(worker, Span::from_milliseconds(10), [] { return false; });
  }
  template <class Ready>
  bool wait(Worker& worker, Span at_most, Ready ready) {
    return worker.parking.wait_until(monotonic_ns() + at_most.ns, [&] { return ready() || stopping(); });
  }

  RealtimeSettings settings;
  RealtimePorts ports;
  Pace pace;
  std::string memory_not_locked;
  std::atomic<bool> armed{false}, stopped{false};

  // The stages; each belongs to its thread.
  std::optional<TrackStage> track_stage;
  RecordedTracks recorded;
  EstimateStage estimate_stage;
  ImuFeed track_feed, estimate_feed;

  // What lies between the threads.
  std::array<Frame, kMostSlots> slots{};  ///< written by capture, read by whoever holds the slot
  NewestRing<4> frames;
  ImuRing imu_to_track, imu_to_estimate;
  SpscRing<Tracked, 4> tracked;
  SpscRing<Knowledge, 4> knowledge;
  LatestValue<Estimate> newest;
  SpscRing<FrameOutcome, 256> outcomes;
  SpscRing<Publication, 256> publications;

  // The tracker's own.
  Knowledge known;
  std::uint64_t frames_tracked = 0, lessons = 0;  ///< lessons: taken from `knowledge`
  int previous_slot = -1;
  // The publisher's own.
  std::uint64_t last_published = 0;

  // Each written by one thread.
  std::atomic<std::uint64_t> frames_in{0}, frames_out{0}, imu_in{0}, track_imu_late{0}, estimate_imu_late{0},
      published{0}, publish_failed{0};

  Worker imu, capture, track, estimate, publish, log;
};

namespace {
void bump(std::atomic<std::uint64_t>& counter) {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}
Knowledge knowledge_of(const EstimateStage& stage) {
  const HostStamp zero{};
  const Vec3 bias = stage.estimator().gyroscope_bias();
  return {
      {bias.x(), bias.y(), bias.z()}, stage.estimator().odometry().time_offset_s, stage.imu_needed_until(zero) - zero};
}
}  // namespace

RealtimePipeline::Impl::Impl(const RealtimeSettings& s, const RealtimePorts& p)
    : settings(s), ports(p), recorded(Camera(s.camera)), estimate_stage(s.estimator, monotonic_ns) {
  if (s.images) track_stage.emplace(Camera(s.camera), s.tracker, s.estimator.extrinsics.R_BC);
  known = knowledge_of(estimate_stage);
  const RealtimeConfig& r = s.realtime;
  const auto set_up = [&](Worker& w, const char* name, int priority, int cpu, void (Impl::*loop)()) {
    w.name = name;
    w.priority = priority;
    w.cpu = cpu;
    w.loop = loop;
    w.owner = this;
  };
  set_up(imu, "imu", r.priority_imu, r.cpu_imu, &Impl::imu_loop);
  set_up(capture, "capture", r.priority_capture, r.cpu_capture, &Impl::capture_loop);
  set_up(track, "track", r.priority_track, r.cpu_track, &Impl::track_loop);
  set_up(estimate, "estimate", r.priority_estimate, r.cpu_estimate, &Impl::estimate_loop);
  set_up(publish, "publish", r.priority_publish, r.cpu_publish, &Impl::publish_loop);
  set_up(log, "log", 0, -1, &Impl::log_loop);
}

void RealtimePipeline::Impl::start(Worker& worker) {
  if (!worker.thread.start({worker.name, worker.priority, worker.cpu}, run, &worker)) {
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

void RealtimePipeline::Impl::imu_loop() {
  std::array<ImuSample, 64> samples;
  while (!stopping()) {
    std::size_t count = 0;
    const ReadOutcome outcome = ports.imu->read(samples, count, kPoll);
    if (outcome == ReadOutcome::kEnd) break;
    if (outcome == ReadOutcome::kFailed) rest_after_failure(imu);
    if (outcome != ReadOutcome::kSample) continue;
    for (std::size_t i = 0; i < count; ++i) {
      if (track_stage) imu_to_track.push(samples[i]);  // a full ring refuses, and counts
      imu_to_estimate.push(samples[i]);
      bump(imu_in);
    }
    track.parking.notify();
    estimate.parking.notify();
  }
  end(imu, {&track, &estimate});
}

void RealtimePipeline::Impl::capture_loop() {
  while (!stopping()) {
    Frame frame;
    const ReadOutcome outcome = ports.camera->read(frame, kPoll);
    if (outcome == ReadOutcome::kEnd) break;
    if (outcome == ReadOutcome::kFailed) rest_after_failure(capture);
    if (outcome != ReadOutcome::kSample) continue;
    EPILINE_EXPECTS(frame.slot >= 0 && frame.slot < kMostSlots, "a camera numbers its buffers from 0 to 255");
    bump(frames_in);
    slots[static_cast<std::size_t>(frame.slot)] = frame;
    const auto evicted = frames.push(static_cast<NewestRing<4>::Value>(frame.slot));
    track.parking.notify();
    if (evicted != NewestRing<4>::kNone) give_back(evicted);
  }
  end(capture, {&track});
}

/// Feeds a stage with the readings that belong before an image; waits for those that have not come yet.
template <class Stage>
void RealtimePipeline::Impl::take_imu(Worker& worker, ImuRing& ring, ImuFeed& feed, HostStamp needed, Stage& stage) {
  const Span at_most = Span::from_seconds(1e-3 * settings.realtime.imu_wait_ms);
  while (feed.wants_more(needed)) {
    bool ended = false;
    const bool came = wait(worker, at_most, [&] {
      ended = has_ended(imu);  // before the look at the ring: what came before the end is found
      return ring.front() != nullptr || ended;
    });
    if (ring.front() == nullptr) {
      if (!came) bump(&worker == &track ? track_imu_late : estimate_imu_late);
      return;
    }
    feed.took(*ring.front());
    stage.add_imu(*ring.front());
    ring.pop();
  }
}

/// No image comes: the oldest readings go to the stage, which would get them anyway, before the ring is full.
template <class Stage>
void RealtimePipeline::Impl::relieve(ImuRing& ring, ImuFeed& feed, Stage& stage) {
  while (ring.published() - ring.popped() > kImuRing / 2 && ring.front() != nullptr) {
    feed.took(*ring.front());
    stage.add_imu(*ring.front());
    ring.pop();
  }
}

void RealtimePipeline::Impl::track_loop() {
  const auto overtaken = [&](NewestRing<4>::Value slot) { give_back(slot); };
  while (!stopping()) {
    bool ended = false;
    wait(track, kPoll, [&] {
      ended = has_ended(capture);
      return frames.ready() || ended;
    });
    const auto slot = frames.pop(overtaken);
    if (slot != NewestRing<4>::kNone) {
      track_frame(slots[slot]);
      // the tracker needs the pixels of the image before until the step of the next one is done
      if (previous_slot >= 0) give_back(static_cast<NewestRing<4>::Value>(previous_slot));
      previous_slot = slot;
    } else if (ended && !frames.ready()) {
      break;
    } else if (track_stage) {
      relieve(imu_to_track, track_feed, *track_stage);
    }
  }
  end(track, {&estimate});
}

/// Takes over what the estimator knew after the image before: the same lesson before the same image, as offline.
void RealtimePipeline::Impl::learn() {
  while (lessons < frames_tracked && !stopping()) {
    wait(track, kPoll, [&] { return knowledge.front() != nullptr; });
    lessons += knowledge.pop(known) ? 1 : 0;
  }
}

void RealtimePipeline::Impl::track_frame(const Frame& frame) {
  learn();
  Tracked* const out = tracked.claim();
  EPILINE_EXPECTS(out != nullptr || stopping(), "the tracker is never more images ahead than the ring holds");
  if (out == nullptr) return;
  const std::int64_t called_ns = monotonic_ns();
  if (track_stage) {
    take_imu(track, imu_to_track, track_feed, frame.stamp + known.imu_after_image, *track_stage);
    const std::int64_t began_ns = monotonic_ns();
    track_stage->set_knowledge(Vec3(known.gyroscope_bias_rad_s.data()), known.time_offset_s);
    track_stage->step(frame, out->frame);
    out->track_ns = monotonic_ns() - began_ns;
  } else {
    const auto points = settings.recorded[frame.sequence];
    recorded.step(frame.stamp, points.data(), points.size(), out->frame);
    out->track_ns = 0;
  }
  out->deadline_ns = deadline_of(frame.stamp, called_ns);
  tracked.publish();
  ++frames_tracked;
  estimate.parking.notify();
}

std::int64_t RealtimePipeline::Impl::deadline_of(HostStamp image, std::int64_t began_ns) const {
  const auto span_ns = [](double ms) { return Span::from_seconds(ms * 1e-3).ns; };
  std::int64_t deadline = EstimateStage::kNoDeadline;
  if (settings.deadline_ms > 0) deadline = began_ns + span_ns(settings.deadline_ms);
  if (settings.realtime.deadline_ms > 0)
    deadline = std::min(deadline, pace.host_of(image) + span_ns(settings.realtime.deadline_ms));
  return deadline;
}

void RealtimePipeline::Impl::estimate_loop() {
  while (!stopping()) {
    bool ended = false;
    wait(estimate, kPoll, [&] {
      ended = has_ended(track);
      return tracked.front() != nullptr || ended;
    });
    if (const Tracked* const next = tracked.front()) {
      estimate_frame(*next);
      tracked.pop();
    } else if (ended) {
      break;
    } else {
      relieve(imu_to_estimate, estimate_feed, estimate_stage);
    }
  }
  end(estimate, {&publish, &log});
}

void RealtimePipeline::Impl::estimate_frame(const Tracked& image) {
  take_imu(estimate, imu_to_estimate, estimate_feed, estimate_stage.imu_needed_until(image.frame.stamp),
           estimate_stage);
  const StepResult result = estimate_stage.step(image.frame, image.deadline_ns);
  const std::uint64_t serial = frames_out.load(std::memory_order_relaxed);
  // first whoever waits for the odometry, then the next image, then the record
  Estimate& draft = newest.draft();
  draft.serial = serial + 1;
  draft.has_pose = result.has_pose;
  draft.odometry = estimate_stage.estimator().odometry();
  newest.publish();
  publish.parking.notify();
  knowledge.push(knowledge_of(estimate_stage));
  track.parking.notify();
  if (FrameOutcome* const out = outcomes.claim()) {
    describe(image.frame, result, estimate_stage, *out);
    out->serial = serial;
    out->track_ns = image.track_ns;
    outcomes.publish();
    log.parking.notify();
  }
  bump(frames_out);
}

void RealtimePipeline::Impl::publish_loop() {
  while (!stopping()) {
    bool ended = false;
    wait(publish, kPoll, [&] {
      ended = has_ended(estimate);
      const Estimate* const e = newest.read();
      return ended || (e != nullptr && e->serial != last_published);
    });
    const Estimate* const e = newest.read();
    if (e != nullptr && e->serial != last_published) {
      publish_estimate(*e);
    } else if (ended) {
      break;
    }
  }
  end(publish, {&log});
}

void RealtimePipeline::Impl::publish_estimate(const Estimate& e) {
  last_published = e.serial;
  bump(published);
  if (!e.has_pose) return;
  if (ports.odometry != nullptr && !ports.odometry->publish(e.odometry)) bump(publish_failed);
  publications.push({e.serial - 1, monotonic_ns() - pace.host_of(e.odometry.stamp)});
  log.parking.notify();
}

void RealtimePipeline::Impl::log_loop() {
  while (!stopping()) {
    bool ended = false;
    wait(log, kPoll, [&] {
      ended = has_ended(estimate) && has_ended(publish);
      return outcomes.front() != nullptr || publications.front() != nullptr || ended;
    });
    const bool empty = outcomes.front() == nullptr && publications.front() == nullptr;
    for (const FrameOutcome* o = outcomes.front(); o != nullptr; o = outcomes.front()) {
      ports.log->take(*o);
      outcomes.pop();
    }
    for (Publication p; publications.pop(p);) ports.log->published(p.serial, p.latency_ns);
    if (empty && ended) break;
  }
  end(log, {});
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
}

RealtimePipeline::~RealtimePipeline() {
  stop();
  join();
}

void RealtimePipeline::arm(const Pace& pace) {
  Impl& m = *impl_;
  m.pace = pace;
  m.memory_not_locked = m.settings.realtime.lock_memory ? lock_memory() : "not asked for";
  m.armed.store(true, std::memory_order_release);
  m.each([](Impl::Worker& worker) { worker.parking.notify(); });
}

bool RealtimePipeline::finished() const noexcept { return impl_->has_ended(impl_->log) || impl_->stopping(); }

std::uint64_t RealtimePipeline::frames_out() const noexcept {
  return impl_->frames_out.load(std::memory_order_relaxed);
}

void RealtimePipeline::stop() noexcept {
  impl_->stopped.store(true, std::memory_order_release);
  impl_->each([](Impl::Worker& worker) { worker.parking.notify(); });
}

void RealtimePipeline::join() noexcept {
  impl_->each([](Impl::Worker& worker) { worker.thread.join(); });
}

RealtimeReport RealtimePipeline::report() const {
  Impl& m = *impl_;
  RealtimeReport r;
  m.each([&](const Impl::Worker& w) { r.threads.push_back({w.name, w.priority, w.thread.shortfall(), w.costs}); });
  const auto ring = [&](const char* name, const auto& of) {
    r.rings.push_back({name, of.capacity(), of.high_water(), of.popped(), of.dropped()});
  };
  r.frames_overtaken = m.frames.evicted() + m.frames.overtaken();
  r.rings.push_back({"frames", m.frames.capacity(), m.frames.high_water(), m.frames.popped(), r.frames_overtaken});
  ring("imu_to_track", m.imu_to_track);
  ring("imu_to_estimate", m.imu_to_estimate);
  ring("tracked", m.tracked);
  ring("knowledge", m.knowledge);
  ring("outcomes", m.outcomes);
  ring("publications", m.publications);
  r.frames_in = m.frames_in.load();
  r.frames_out = m.frames_out.load();
  r.imu_in = m.imu_in.load();
  r.imu_late = m.track_imu_late.load() + m.estimate_imu_late.load();
  r.published = m.published.load();
  r.publish_failed = m.publish_failed.load();
  r.superseded = r.frames_out - r.published;
  r.memory_not_locked = m.memory_not_locked;
  return r;
}

const Estimator& RealtimePipeline::estimator() const noexcept { return impl_->estimate_stage.estimator(); }

const TrackerStats* RealtimePipeline::tracker_stats() const noexcept {
  return impl_->track_stage ? &impl_->track_stage->stats() : nullptr;
}

}  // namespace epiline
