#include "drivers/program/view/view_model.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "platform/log/event.h"

namespace epiline {

namespace {

const char* name_of(HealthState state) {
  return kHealthStateNames[static_cast<std::size_t>(state) % kHealthStateNames.size()];
}

Json names_of(std::uint32_t reasons) {
  Json names = Json::array();
  for (std::size_t i = 0; i < kHealthReasonNames.size(); ++i)
    if ((reasons & (1u << i)) != 0) names.push_back(kHealthReasonNames[i]);
  return names;
}

/// With `digits` after the point: fewer bytes. What is not finite becomes null.
Json number(double x, int digits) {
  if (!std::isfinite(x)) return nullptr;
  const double scale = std::pow(10.0, digits);
  return std::round(x * scale) / scale;
}

template <class Numbers>
Json numbers(const Numbers& values, int digits) {
  Json json = Json::array();
  for (const auto v : values) json.push_back(number(static_cast<double>(v), digits));
  return json;
}

/// Rows of Odometry::covariance.
enum Row { kPosition = 0, kAttitude = 3, kVelocity = 6, kAccelerometerBias = 9, kGyroscopeBias = 12, kTimeOffset = 15 };

double covariance(const Odometry& o, int row, int column) {
  return o.covariance[static_cast<std::size_t>(16 * row + column)];
}
double sigma(const Odometry& o, int row) { return std::sqrt(std::max(0.0, covariance(o, row, row))); }
Json sigmas(const Odometry& o, int row, int digits) {
  return numbers(std::array{sigma(o, row), sigma(o, row + 1), sigma(o, row + 2)}, digits);
}

}  // namespace

void PathHistory::add(const std::array<double, 3>& p, HealthState state) {
  if (!std::isfinite(p[0] + p[1] + p[2])) return;
  if (last_) {
    const double moved = std::hypot(p[0] - (*last_)[0], p[1] - (*last_)[1], p[2] - (*last_)[2]);
    if (moved < step_m_) return;
    length_m_ += moved;
  }
  last_ = p;
  if (points_.size() == kMostPoints) {
    for (std::size_t i = 0; i < kMostPoints / 2; ++i) points_[i] = points_[2 * i];
    points_.resize(kMostPoints / 2);
    step_m_ *= 2;
    ++generation_;
  }
  points_.push_back({{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])}, state});
}

void RateMeter::note(std::uint64_t count, HostStamp stamp) {
  if (!readings_.empty() && stamp <= readings_.back().stamp) return;
  readings_.push_back({count, stamp});
  while (readings_.size() > kMostReadings || (readings_.size() > 2 && (stamp - readings_[1].stamp).seconds() > 2))
    readings_.pop_front();
}

double RateMeter::hz() const {
  if (readings_.size() < 2) return 0;
  const Reading &first = readings_.front(), &last = readings_.back();
  return static_cast<double>(last.count - first.count) / (last.stamp - first.stamp).seconds();
}

ViewModel::ViewModel(ViewSubject subject) : subject_(std::move(subject)) {
  std::random_device random;
  run_ = random();
}

void ViewModel::take(const ViewedOutcome& now) {
  const FrameOutcome& o = now.outcome;
  if (!began_) began_ = o.stamp;
  if (o.result.solved) {
    ++solved_;
    solved_times_ = o.times;  // those of an image that is predicted only say little
  }
  note_changes(now);
  images_.note(o.serial + 1, o.stamp);
  imu_.note(now.imu_samples, now.newest_imu);
  if (o.result.has_pose) path_.add(o.odometry.p_WB_m, o.odometry.health.state);
  // serials that never came leave empty samples
  for (; samples_end_ <= o.serial; ++samples_end_) samples_[samples_end_ % kSamples] = {};
  Sample& s = samples_[o.serial % kSamples];
  s.t_s = seconds(o.stamp);
  s.v_W = o.odometry.v_WB_m_s;
  s.quality = o.odometry.health.quality;
  s.tracks = o.tracks;
  s.state = o.odometry.health.state;
  s.has_pose = o.result.has_pose;
  newest_ = now;
}

void ViewModel::take(const Publication& latency) {
  latencies_.add(latency.latency_ns);
  has_latency_ = true;
  last_latency_serial_ = std::max(last_latency_serial_, latency.serial);
  if (latency.serial < samples_end_ && latency.serial + kSamples >= samples_end_)
    samples_[latency.serial % kSamples].latency_ms = 1e-6 * static_cast<double>(latency.latency_ns);
}

void ViewModel::take(const Event& event) {
  if (event.id == EventId::kHealthChanged || event.id == EventId::kReset) return;  // told by the outcomes
  std::array<char, 256> text{};
  format_event(event, text);
  const std::string line(text.data());
  const std::size_t after_time = line.find(' ');
  note(seconds(event.stamp), "event", after_time == std::string::npos ? line : line.substr(after_time + 1), nullptr);
}

void ViewModel::note(double t_s, const char* kind, std::string text, Json details) {
  notes_[notes_end_++ % kEvents] = {t_s, kind, std::move(text), std::move(details)};
}

/// Compares with the image before.
void ViewModel::note_changes(const ViewedOutcome& now) {
  const FrameOutcome& o = now.outcome;
  const double t_s = seconds(o.stamp);
  const Odometry before = newest_ ? newest_->outcome.odometry : Odometry{};
  const Health &was = before.health, &is = o.odometry.health;
  if (newest_ && o.odometry.reset_counter != before.reset_counter) note(t_s, "reset", "", o.odometry.reset_counter);
  if (!newest_ || was.state != is.state) {
    note(t_s, "health", name_of(is.state), names_of(is.reasons));
  } else if ((is.reasons & ~was.reasons) != 0 && is.state != HealthState::kInitialising) {
    note(t_s, "reason", name_of(is.state), names_of(is.reasons & ~was.reasons));
  }
}

Json ViewModel::pose_json() const {
  const Odometry& o = newest_->outcome.odometry;
  Json covariance_p = Json::array();
  for (int r = 0; r < 3; ++r)
    for (int c = r; c < 3; ++c) covariance_p.push_back(covariance(o, kPosition + r, kPosition + c));
  return {{"p", numbers(o.p_WB_m, 4)},
          {"q", numbers(o.q_WB, 6)},
          {"v", numbers(o.v_WB_m_s, 4)},
          {"omega", numbers(o.omega_B_rad_s, 4)},
          {"b_a", numbers(o.accelerometer_bias_m_s2, 5)},
          {"b_g", numbers(o.gyroscope_bias_rad_s, 6)},
          {"time_offset_ms", number(1e3 * o.time_offset_s, 3)},
          {"covariance_p", covariance_p},
          {"sigma_theta", sigmas(o, kAttitude, 6)},
          {"sigma_v", sigmas(o, kVelocity, 5)},
          {"sigma_b_a", sigmas(o, kAccelerometerBias, 6)},
          {"sigma_b_g", sigmas(o, kGyroscopeBias, 7)},
          {"sigma_time_offset_ms", number(1e3 * sigma(o, kTimeOffset), 3)}};
}

Json ViewModel::path_json(const ViewCursor& since) const {
  const auto& points = path_.points();
  const bool known = since.path_generation == path_.generation() && since.path <= points.size();
  const std::size_t from = known ? static_cast<std::size_t>(since.path) : 0;
  Json rows = Json::array();
  for (std::size_t i = from; i < points.size(); ++i) {
    Json row = numbers(points[i].p_W, 3);
    row.push_back(static_cast<int>(points[i].state));
    rows.push_back(std::move(row));
  }
  return {{"generation", path_.generation()}, {"from", from}, {"points", std::move(rows)}};
}

/// A row is sent once, so only when its latency is known or cannot be known any more.
Json ViewModel::samples_json(const ViewCursor& since) const {
  std::uint64_t end = samples_end_;
  while (!finished_ && end > 0 && end + 8 > samples_end_) {
    const Sample& s = samples_[(end - 1) % kSamples];
    if (!s.has_pose || s.latency_ms >= 0 || (has_latency_ && last_latency_serial_ >= end)) break;
    --end;
  }
  const std::uint64_t oldest = samples_end_ > kSamples ? samples_end_ - kSamples : 0;
  const std::uint64_t from = since.sample > end ? oldest : std::max(since.sample, oldest);
  Json rows = Json::array();
  for (std::uint64_t i = from; i < end; ++i) {
    const Sample& s = samples_[i % kSamples];
    rows.push_back({number(s.t_s, 3), s.latency_ms < 0 ? Json(nullptr) : number(s.latency_ms, 3), number(s.v_W[0], 3),
                    number(s.v_W[1], 3), number(s.v_W[2], 3), s.quality, s.tracks, static_cast<int>(s.state)});
  }
  return {{"next", end}, {"rows", std::move(rows)}};
}

Json ViewModel::events_json(const ViewCursor& since) const {
  const std::uint64_t oldest = notes_end_ > kEvents ? notes_end_ - kEvents : 0;
  Json rows = Json::array();
  for (std::uint64_t i = since.event > notes_end_ ? oldest : std::max(since.event, oldest); i < notes_end_; ++i) {
    const Note& n = notes_[i % kEvents];
    rows.push_back({{"t", number(n.t_s, 2)}, {"kind", n.kind}, {"text", n.text}, {"details", n.details}});
  }
  return {{"next", notes_end_}, {"rows", std::move(rows)}};
}

std::string ViewModel::state_json(const ViewCursor& since) const {
  Json s = {
      {"schema", 1}, {"run", run_}, {"title", subject_.title}, {"program", subject_.program}, {"finished", finished_}};
  s["R_BC"] = subject_.R_BC ? numbers(subject_.R_BC->transpose().reshaped(), 6) : Json(nullptr);  // by rows
  s["has_pose"] = newest_ && newest_->outcome.result.has_pose;
  s["t"] = newest_ ? number(seconds(newest_->outcome.stamp), 3) : Json(nullptr);
  const Odometry& o = newest_ ? newest_->outcome.odometry : Odometry{};
  s["health"] = {
      {"state", name_of(o.health.state)}, {"reasons", names_of(o.health.reasons)}, {"quality", o.health.quality}};
  s["resets"] = o.reset_counter;
  s["pose"] = s["has_pose"].get<bool>() ? pose_json() : Json(nullptr);
  s["distance_m"] = number(path_.length_m(), 2);
  const bool any = latencies_.count() > 0;
  const auto from_ns = [](std::int64_t ns) { return number(1e-6 * static_cast<double>(ns), 3); };
  const auto ms = [&](std::int64_t ns) { return any ? from_ns(ns) : Json(nullptr); };
  s["latency_ms"] = {{"count", latencies_.count()},
                     {"p50", ms(latencies_.quantile_ns(0.5))},
                     {"p99", ms(latencies_.quantile_ns(0.99))},
                     {"max", ms(latencies_.most_ns())}};
  const FrameOutcome outcome = newest_ ? newest_->outcome : FrameOutcome{};
  s["time_ms"] = {{"track", from_ns(outcome.track.wall_ns)},
                  {"solve", from_ns(solved_times_.solve.wall_ns)},
                  {"estimate", from_ns(solved_times_.estimate.wall_ns)}};
  s["rates_hz"] = {{"camera", number(images_.hz(), 2)}, {"imu", number(imu_.hz(), 1)}};
  s["counts"] = {{"images", newest_ ? outcome.serial + 1 : 0},
                 {"solved", solved_},
                 {"tracks", outcome.tracks},
                 {"new_tracks", outcome.new_tracks},
                 {"images_lost", newest_ ? newest_->images_lost : 0},
                 {"imu", newest_ ? newest_->imu_samples : 0},
                 {"left_out", left_out_}};
  s["receivers"] = notes_of_receivers_;
  s["image"] = newest_image_;
  s["path"] = path_json(since);
  s["samples"] = samples_json(since);
  s["events"] = events_json(since);
  return s.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string tracks_json(const ViewedImage& image) {
  const auto list = [](const auto& points) {
    Json tracks = Json::array();
    for (const LoggedPoint& p : points)
      tracks.insert(tracks.end(),
                    {p.id, p.age, number(static_cast<double>(p.u), 1), number(static_cast<double>(p.v), 1)});
    return tracks;
  };
  Json json = {{"sequence", image.sequence},
               {"width", image.camera_width},
               {"height", image.camera_height},
               {"has_image", image.width > 0},
               {"tracks", list(image.tracks)}};
  json["others"] = Json::array();
  for (std::size_t i = 0; i < kMostOthers; ++i)
    if (image.others_x[i] > 0)
      json["others"].push_back({{"x", image.others_x[i]}, {"tracks", list(image.other_tracks[i])}});
  return json.dump();
}

}  // namespace epiline
