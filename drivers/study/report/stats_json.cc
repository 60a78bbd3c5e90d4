#include "drivers/study/report/stats_json.h"

#include "drivers/study/report/own_parts.h"
#include "pipeline/text/suspicion_text.h"

namespace epiline {

namespace {

std::optional<double> ratio(double part, double whole) {
  return whole > 0 ? std::optional(part / whole) : std::nullopt;
}
std::optional<double> ratio(std::uint64_t part, std::uint64_t whole) {
  return ratio(static_cast<double>(part), static_cast<double>(whole));
}

Json timing_json(const Summary& s) {
  const auto if_any = [&](double value) { return s.count > 0 ? std::optional(value) : std::nullopt; };
  return {{"count", s.count},     {"mean", if_any(s.mean)}, {"p50", if_any(s.median)}, {"p90", if_any(s.p90)},
          {"p99", if_any(s.p99)}, {"p999", if_any(s.p999)}, {"max", if_any(s.max)}};
}

Json images_json(const FlightRecord& r) {
  std::uint64_t skipped = 0;
  Json reasons = Json::object();
  for (const auto& [reason, count] : r.skipped) {
    reasons[reason] = count;
    skipped += count;
  }
  return {{"read", r.images_read},
          {"tracked", r.images.size()},
          {"solved", r.estimator.frames_solved},
          {"predicted", r.estimator.frames_predicted},
          {"without_pose", r.estimator.frames_without_pose},
          {"keyframes", r.estimator.keyframes},
          {"skipped", skipped},
          {"skipped_by_reason", reasons}};
}

Json imu_json(const FlightRecord& r) {
  const EstimatorStats& e = r.estimator;
  const ImuLeftOut left_out = imu_left_out(r);
  return {{"read", r.imu_read},
          {"used", e.imu_samples},
          {"out_of_order", left_out.out_of_order},
          {"duplicate", left_out.duplicate},
          {"not_finite", left_out.not_finite},
          {"impossible", left_out.impossible},
          {"far_ahead", e.imu_far_ahead},
          {"suspect", e.imu_suspect},
          {"bridged", e.imu_bridged},
          {"gaps", e.imu_gaps},
          {"saturated", e.imu_saturated}};
}

/// Of each kind of height sensor that sent any.
Json heights_json(const EstimatorStats& stats) {
  constexpr std::array kNames{"barometer", "range_finder"};
  Json json = Json::object();
  for (std::size_t i = 0; i < kHeightKinds; ++i) {
    if (stats.height_samples[i] + stats.height_refused[i] == 0) continue;
    json[kNames[i]] = {{"samples", stats.height_samples[i]},
                       {"refused", stats.height_refused[i]},
                       {"frames", stats.height_frames[i]},
                       {"jumps", stats.height_jumps[i]}};
  }
  return json;
}

Json wheels_json(const EstimatorStats& stats) {
  if (stats.wheel_samples + stats.wheel_refused == 0) return Json::object();
  return {{"samples", stats.wheel_samples},
          {"refused", stats.wheel_refused},
          {"frames", stats.wheel_frames},
          {"slips", stats.wheel_slips}};
}

/// What the gates of pipeline/watch found besides.
Json watch_json(const FlightRecord& r) {
  const ImuGateStats& i = r.imu_watch;
  const ImageGateStats& c = r.image_watch;
  return {{"imu",
           {{"suspect_stamps", i.suspect},
            {"clock_steps", i.clock_steps},
            {"stuck", i.stuck},
            {"straightened", i.straightened}}},
          {"images",
           {{"suspect_stamps", c.suspect},
            {"old_stamps", c.old},
            {"clock_steps", c.clock_steps},
            {"frozen", c.frozen},
            {"copies", c.copies},
            {"covered", c.covered},
            {"obstructed", c.obstructed},
            {"exposure_steps", c.exposure_steps}}}};
}

Json initialisation_json(const FlightRecord& r) {
  Json reasons = Json::object();
  for (int i = 0; i < static_cast<int>(StartRefusal::kCount); ++i) {
    if (r.estimator.start_refused[i] > 0)
      reasons[to_string(static_cast<StartRefusal>(i))] = r.estimator.start_refused[i];
  }
  constexpr std::array<const char*, 5> kKinds{nullptr, "given", "stationary", "moving", "carried"};
  const char* const kind = kKinds[static_cast<std::size_t>(r.estimator.start_kind)];
  const auto seconds = start_seconds(r);
  return {{"done", seconds.has_value()},
          {"seconds_after_first_image", seconds},
          {"kind", kind ? Json(kind) : Json(nullptr)},
          {"attempts", r.estimator.start_attempts},
          {"refused_by_reason", reasons}};
}

Json calibration_json(const FlightRecord& r) {
  const FoundCalibration& c = r.estimator.calibration;
  if (!c.known) return nullptr;
  const auto& s = c.sigmas;
  return {{"time_offset_s", c.time_offset_s},
          {"q_BC", c.q_BC},
          {"p_BC_m", c.p_BC_m},
          {"focal_ratio", c.focal_ratio},
          {"lens_edge_ratio", c.lens_edge_ratio},
          {"accelerometer_scale", c.accelerometer_scale},
          {"gyroscope_scale", c.gyroscope_scale},
          {"sigma",
           {{"time_offset_s", s[0]},
            {"rotation_rad", {s[1], s[2], s[3]}},
            {"p_BC_m", {s[4], s[5], s[6]}},
            {"focal_ratio", s[7]},
            {"lens_edge_ratio", s[8]},
            {"accelerometer_scale", s[9]},
            {"gyroscope_scale", s[10]}}}};
}

/// Numbers of the user that the flight contradicts.
Json numbers_json(const FlightRecord& r) {
  Json numbers = Json::array();
  for (std::size_t i = 0; i < r.estimator.suspicions.size(); ++i) {
    const Suspicion& s = r.estimator.suspicions[i];
    if (s.severity == Severity::kNone) continue;
    const auto suspect = static_cast<Suspect>(i);
    numbers.push_back({{"what", to_string(suspect)},
                       {"severity", to_string(s.severity)},
                       {"figure", s.figure},
                       {"text", text_of(suspect, s)}});
  }
  return numbers;
}

Json settings_json(const FlightRecord& r) {
  return {{"visual_factor", r.visual_factor}, {"keyframes", r.keyframes},           {"max_features", r.max_features},
          {"deadline_ms", r.deadline_ms},     {"realtime", r.realtime.has_value()}, {"threads", r.threads}};
}

/// How often each event happened.
Json events_json(const FlightRecord& r) {
  Json by_name = Json::object();
  for (const Event& event : r.events) {
    Json& count = by_name[to_string(event.id)];
    count = count.is_null() ? 1 : count.get<int>() + 1;
  }
  return {{"by_name", by_name}, {"lost", r.events_lost}};
}

Json recorder_json(const RealtimeRecord& r) {
  if (!r.recorder) return nullptr;
  return {{"written", r.recorder->written},
          {"failed", r.recorder->failed},
          {"lost", r.recorder->lost},
          {"memory_mib", static_cast<double>(r.recorder->memory_bytes) / (1 << 20)}};
}

Json other_json(std::size_t camera, const SecondStats& s) {
  return {{"camera", camera},
          {"images", s.images - s.images_missing},
          {"images_missing", s.images_missing},
          {"share_of_tracks", ratio(s.views, s.tracks)},
          {"tried", s.tried},
          {"matched", s.matched},
          {"followed", s.followed},
          {"lost", s.lost},
          {"off_plane", s.off_plane},
          {"wrong_side", s.wrong_side},
          {"tracks_of_its_own", s.alone}};
}

Json tracks_json(const FlightRecord& r) {
  std::uint64_t points = 0, tracks = 0;
  for (const ImageRecord& image : r.images) {
    points += static_cast<std::uint64_t>(image.tracks);
    tracks += static_cast<std::uint64_t>(image.new_tracks);
  }
  const auto rejected =
      r.tracker ? ratio(r.tracker->rejected_near + r.tracker->rejected_wide, r.tracker->tried) : std::nullopt;
  Json others = Json::array();
  for (std::size_t i = 0; i < r.others.size(); ++i)
    if (r.others[i]) others.push_back(other_json(i + 1, *r.others[i]));
  return {{"per_image_mean", ratio(points, r.images.size())},
          {"length_mean", ratio(points, tracks)},
          {"rejected_share", rejected},
          {"own_parts_share", r.tracker ? Json(own_share(r.tracker->own_cells)) : Json(nullptr)},
          {"noise_px", r.estimator.frames_solved > 0 ? Json(r.estimator.pixel_sigma) : Json(nullptr)},
          {"gated", r.estimator.gated},
          {"other_cameras", others}};
}

/// What was given up for lack of time.
Json load_json(const FlightRecord& r) {
  Json levels = Json::object();
  for (std::size_t i = 0; i < kLoadLevels; ++i) levels[kLoadLevelNames[i]] = r.load.frames[i];
  return {{"frames_at_level", levels},
          {"lowered", r.load.lowered},
          {"raised", r.load.raised},
          {"solved_to_survive", r.load.let_through},
          {"solves_over_budget", r.load.over_budget}};
}

Json latency_json(const LatencyBins& bins) {
  const auto ms = [](std::int64_t ns) { return 1e-6 * static_cast<double>(ns); };
  return {{"p50", ms(bins.quantile_ns(0.5))}, {"p99", ms(bins.quantile_ns(0.99))}, {"max", ms(bins.most_ns())}};
}

/// What each receiver got.
Json outputs_json(const RealtimeRecord& r) {
  Json outputs = Json::object();
  for (const OutputRecord& output : r.outputs) {
    outputs[output.name] = {{"sent", output.sent},
                            {"not_sent", output.not_sent},
                            {"reopened", output.reopened},
                            {"images", output.latency.count()},
                            {"latency_ms", output.latency.count() > 0 ? latency_json(output.latency) : Json(nullptr)}};
  }
  return outputs;
}

Json clock_json(const ClockState& c) {
  const auto us = [](Span span) { return 1e-3 * static_cast<double>(span.ns); };
  return {{"status", kClockStatusNames[static_cast<std::size_t>(c.status)]},
          {"skew_ppm", c.skew_ppm},
          {"residual_rms_us", us(c.residual_rms)},
          {"residual_max_us", us(c.residual_most)},
          {"bound_us", us(c.bound)},
          {"samples", c.samples},
          {"late", c.late},
          {"outliers", c.outliers},
          {"jumps", c.jumps}};
}

/// What each driver counted.
Json devices_json(const RealtimeRecord& r) {
  Json devices = Json::object();
  for (const DeviceRecord& device : r.devices) {
    Json& json = devices[device.name] = Json::object();
    for (const DeviceCount& c : device.counts) json[c.name] = c.value;
    json["clock"] = device.clock ? clock_json(*device.clock) : Json(nullptr);
  }
  return devices;
}

/// What went out at the IMU's rate.
Json prediction_json(const RealtimeRecord& realtime) {
  const RealtimeReport& r = realtime.report;
  const auto& path = realtime.predicted;
  return {{"published", r.predicted},
          {"failed", r.predict_failed},
          {"corrections", r.prediction.corrections},
          {"jumps", r.prediction.jumps},
          {"not_taken", r.prediction.old + r.prediction.not_finite + r.prediction.no_readings},
          {"latency_ms", latency_json(r.prediction_latency)},
          {"largest_jump_m", path ? Json(path->largest_jump_m) : Json(nullptr)},
          {"largest_jump_rad", path ? Json(path->largest_jump_rad) : Json(nullptr)},
          {"largest_jump_m_s", path ? Json(path->largest_jump_m_s) : Json(nullptr)}};
}

/// What only a run with threads has; null otherwise.
Json realtime_json(const FlightRecord& r) {
  if (!r.realtime) return nullptr;
  const RealtimeReport& report = r.realtime->report;
  Json threads = Json::object(), rings = Json::object();
  for (const RealtimeReport::Thread& t : report.threads) {
    threads[t.name] = {{"priority", t.shortfall.priority ? 0 : t.priority},
                       {"heap_allocations", r.heap_calls ? Json(t.costs.heap_calls) : Json(nullptr)},
                       {"lock_calls", r.lock_calls ? Json(t.costs.lock_calls) : Json(nullptr)},
                       {"page_faults", t.costs.page_faults},
                       {"switched_out", t.costs.switched_out},
                       {"cpu_s", 1e-9 * static_cast<double>(t.costs.cpu_ns)},
                       {"stack_kib", t.stack_bytes / 1024},
                       {"stack_used_kib", (t.stack_used + 1023) / 1024}};
  }
  for (const RealtimeReport::Ring& ring : report.rings) {
    rings[ring.name] = {{"capacity", ring.capacity},
                        {"high_water", ring.high_water},
                        {"passed", ring.passed},
                        {"dropped", ring.dropped}};
  }
  return {{"speed", r.realtime->speed},
          {"memory_locked", report.memory_not_locked.empty()},
          {"shortfalls", r.realtime->shortfalls},
          {"frames_in", report.frames_in},
          {"frames_out", report.frames_out},
          {"imu_in", report.imu_in},
          {"imu_late", report.imu_late},
          {"published", report.published},
          {"superseded", report.superseded},
          {"publish_failed", report.publish_failed},
          {"late", report.late},
          {"prediction", prediction_json(*r.realtime)},
          {"outputs", outputs_json(*r.realtime)},
          {"devices", devices_json(*r.realtime)},
          {"images_not_logged", report.images_not_logged},
          {"recorder", recorder_json(*r.realtime)},
          {"lock_calls_after_start", r.lock_calls},
          {"threads", threads},
          {"rings", rings}};
}

StageSummaries summaries_of(const FlightRecord& record, StageMilliseconds ImageRecord::*clock) {
  const auto summary = [&](double StageMilliseconds::*stage) { return summarise(times_of(record, stage, clock)); };
  std::vector<double> frame;
  for (const ImageRecord& image : record.images) frame.push_back((image.*clock).frame());
  return {summary(&StageMilliseconds::track), summary(&StageMilliseconds::solve),
          summary(&StageMilliseconds::marginalise), summary(&StageMilliseconds::estimate), summarise(std::move(frame))};
}

Json stages_json(const StageSummaries& s) {
  return {{"track", timing_json(s.track)},
          {"solve", timing_json(s.solve)},
          {"marginalise", timing_json(s.marginalise)},
          {"estimate", timing_json(s.estimate)},
          {"frame", timing_json(s.frame)}};
}

Json errors_json(const FlightRecord& r, const std::optional<TrajectoryErrors>& errors) {
  Json json = to_json(errors.value_or(TrajectoryErrors{}));
  if (!errors) {
    json["poses"] = nullptr;
    json["rpe"] = nullptr;
    json["motion"] = nullptr;
  } else {
    json["coverage"] = coverage(r);
  }
  return json;
}

}  // namespace

std::vector<double> times_of(const FlightRecord& record, double StageMilliseconds::*stage,
                             StageMilliseconds ImageRecord::*clock) {
  std::vector<double> ms;
  for (const ImageRecord& image : record.images) {
    const bool ran = stage == &StageMilliseconds::track ? record.tracker.has_value() : image.solved;
    if (ran) ms.push_back(image.*clock.*stage);
  }
  return ms;
}

std::vector<double> latencies_of(const FlightRecord& record) {
  std::vector<double> ms;
  for (const ImageRecord& image : record.images)
    if (image.latency_ms) ms.push_back(*image.latency_ms);
  return ms;
}

Timing timing_of(const FlightRecord& record) {
  return {summaries_of(record, &ImageRecord::wall_ms), summaries_of(record, &ImageRecord::cpu_ms),
          summarise(latencies_of(record))};
}

std::array<double, 4> state_seconds(const FlightRecord& record) {
  std::array<double, 4> seconds{};
  for (std::size_t i = 1; i < record.images.size(); ++i) {
    const ImageRecord& before = record.images[i - 1];
    seconds[static_cast<std::size_t>(before.health.state)] += (record.images[i].stamp - before.stamp).seconds();
  }
  return seconds;
}

std::optional<double> start_seconds(const FlightRecord& record) {
  for (const ImageRecord& image : record.images) {
    if (image.has_pose) return (image.stamp - record.images.front().stamp).seconds();
  }
  return std::nullopt;
}

std::optional<double> coverage(const FlightRecord& record) {
  std::size_t poses = 0, images = 0;
  for (const ImageRecord& image : record.images) {
    poses += image.has_pose;
    images += poses > 0;
  }
  if (images == 0) return std::nullopt;
  return static_cast<double>(poses) / static_cast<double>(images);
}

Json to_json(const ProgramInfo& program) {
  return {{"version", program.version},
          {"commit", program.commit},
          {"compiler", program.compiler},
          {"build_type", program.build_type},
          {"simd", program.simd}};
}

Json stats_json(const FlightRecord& r, const std::optional<TrajectoryErrors>& errors, const ProgramInfo& program) {
  const Timing timing = timing_of(r);
  const std::array<double, 4> seconds = state_seconds(r);
  const EstimatorStats& e = r.estimator;
  Json json;
  json["schema"] = 1;
  json["program"] = to_json(program);
  json["dataset"] = {{"path", r.dataset_path},
                     {"duration_s", r.dataset_duration_s},
                     {"images", r.dataset_images},
                     {"imu_samples", r.dataset_imu_samples},
                     {"has_ground_truth", r.truth.has_value()}};
  json["settings"] = settings_json(r);
  json["images"] = images_json(r);
  json["imu"] = imu_json(r);
  json["heights"] = heights_json(e);
  json["wheels"] = wheels_json(e);
  json["watch"] = watch_json(r);
  json["initialisation"] = initialisation_json(r);
  json["calibration"] = calibration_json(r);
  json["numbers_wrong"] = numbers_json(r);
  json["resets"] = e.resets;
  json["state_seconds"] = {
      {"initialising", seconds[0]}, {"tracking", seconds[1]}, {"degraded", seconds[2]}, {"lost", seconds[3]}};
  json["timing_ms"] = stages_json(timing);
  json["timing_ms"]["latency"] = timing_json(timing.latency);
  json["cpu_ms"] = stages_json(timing.cpu);
  json["events"] = events_json(r);
  json["solver"] = {{"iterations_mean", ratio(e.iterations, e.solves)},
                    {"residuals_mean", ratio(e.residuals, e.solves)},
                    {"state_size_mean", ratio(e.state_size, e.solves)},
                    {"tracks_mean", ratio(e.tracks_used, e.solves)},
                    {"deadline_hits", e.deadline_hits}};
  json["load"] = load_json(r);
  json["tracks"] = tracks_json(r);
  json["memory"] = {{"peak_rss_mib", r.peak_rss_mib},
                    {"heap_allocations_after_start", r.heap_calls},
                    {"page_faults_after_start", r.page_faults}};
  json["realtime"] = realtime_json(r);
  json["error"] = errors_json(r, errors);
  return json;
}

}  // namespace epiline
