#include "pipeline/stages/estimate_stage.h"

namespace epiline {

EstimateStage::EstimateStage(const EstimateStageSettings& settings, const FlightClock& clock, const Inputs& in,
                             const Outputs& out)
    : clock_(clock),
      deadline_ms_(settings.deadline_ms),
      in_(in),
      out_(out),
      back_end_(settings.estimator, clock.clocks, Span::from_seconds(1e-3 * settings.solve_ms).ns),
      events_(out.events),
      imu_(in.imu, in.imu_ended, settings.imu_patience, clock.clocks.wall, out.events) {}

bool EstimateStage::ready() noexcept {
  return imu_.begun() ? imu_.ready() : in_.tracked.front() != nullptr || in_.tracker_ended.is_set();
}

Step EstimateStage::step() noexcept {
  const bool over = in_.tracker_ended.is_set();  // before the look at the ring: what came before the end is found
  const Tracked* const image = in_.tracked.front();
  if (image == nullptr) return wait_for_image(over);
  if (!imu_.begun()) imu_.begin(back_end_.imu_needed_until(image->frame.stamp));
  const bool complete = imu_.take([&](const ImuSample& reading) { give(reading); });
  if (!complete) return Step::nothing_until(imu_.waits_until_ns());
  take_side_samples();
  estimate(*image);
  in_.tracked.pop();
  return Step::work();
}

Step EstimateStage::wait_for_image(bool over) noexcept {
  if (over) return Step::end();
  imu_.relieve([&](const ImuSample& reading) { give(reading); });
  take_side_samples();
  return Step::nothing_until(clock_.now_ns() + kIdle.ns);
}

void EstimateStage::give(const ImuSample& reading) noexcept {
  back_end_.add_imu(reading);
  events_.after_imu(reading, back_end_);
}

/// Whatever has come. The estimator finds the frames it belongs to, also those before.
void EstimateStage::take_side_samples() noexcept {
  for (WheelSample speed; in_.speeds.pop(speed);) back_end_.add_wheel(speed);
  for (HeightSample height; in_.heights.pop(height);) back_end_.add_height(height);
}

std::int64_t EstimateStage::deadline_of(HostStamp image) const noexcept {
  if (deadline_ms_ <= 0) return BackEnd::kNoDeadline;
  return clock_.pace->host_of(image) + Span::from_seconds(1e-3 * deadline_ms_).ns;
}

/// Serves the publisher first, because it waits for the odometry; then the tracker, the window, and the log.
void EstimateStage::estimate(const Tracked& image) noexcept {
  const StepResult result = back_end_.step(image.frame, deadline_of(image.frame.stamp));
  hand_to_publisher(result);
  out_.knowledge.push(knowledge());
  out_.tracker.notify();
  const bool keyframe = back_end_.slide();
  events_.after_image(image.frame, back_end_);
  describe(image.frame, result, keyframe, back_end_, outcome_);
  outcome_.serial = images_.get();
  outcome_.track = image.track;
  hand_to_log(image.frame);
  images_.bump();
}

void EstimateStage::hand_to_publisher(const StepResult& result) noexcept {
  if (out_.newest == nullptr) return;
  Estimate& draft = out_.newest->draft();
  draft.serial = images_.get() + 1;
  draft.has_pose = result.has_pose;
  draft.odometry = back_end_.odometry();
  if (result.solved) {
    solved_serial_ = draft.serial;
    solved_ = draft.odometry;
  }
  draft.solved_serial = solved_serial_;
  draft.solved = solved_;
  out_.newest->publish();
  out_.publisher->notify();
}

void EstimateStage::hand_to_log(const TrackedFrame& frame) noexcept {
  if (!out_.log) return;
  out_.log->outcomes.push(outcome_);
  if (LoggedTracks* const t = out_.log->tracks.claim()) {
    t->serial = outcome_.serial;
    t->sequence = frame.sequence;
    t->stamp = frame.stamp;
    t->points.clear();
    for (const TrackedFeature& f : frame.features) t->points.push_back({f.id, f.age, f.pixel[0], f.pixel[1]});
    for (std::size_t i = 0; i < kMostOthers; ++i) {
      auto& other = t->others[i];
      other.clear();
      for (const SecondView& v : frame.others[i].views) other.push_back({v.id, v.age, v.pixel[0], v.pixel[1]});
      for (const TrackedFeature& f : frame.others[i].alone) other.push_back({f.id, f.age, f.pixel[0], f.pixel[1]});
    }
    out_.log->tracks.publish();
  }
  out_.log->parking.notify();
}

}  // namespace epiline
