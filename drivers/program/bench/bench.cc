#include "drivers/program/bench/bench.h"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "drivers/program/bench/made_up_flight.h"
#include "drivers/study/report/program_info.h"
#include "drivers/study/report/stats_json.h"
#include "pipeline/config/config.h"
#include "pipeline/stages/imu_feed.h"
#include "pipeline/stages/offline.h"
#include "platform/linux/realtime.h"
#include "platform/time/monotonic.h"

namespace epiline {
namespace {

constexpr double kMostError_m = 0.1;  // ten times the error of a right build
constexpr double kMostStart_s = 2;    // a start takes half a second

OfflineSettings settings_of(const CameraCalibration& camera) {
  Config config;
  set_calibration(camera, config.estimator);
  OfflineSettings settings;
  settings.camera = camera.parameters;
  settings.tracker = config.tracker;
  settings.estimator = config.estimator;
  settings.clocks = {monotonic_ns, thread_cpu_ns};
  return settings;
}

Error wrong(const std::string& found, const std::string& expected) {
  return {ErrorKind::kRun, "", 0, "the odometry is wrong: " + found,
          expected + "; do not fly with this computer (docs/boards.md)"};
}

std::string or_dash(const std::optional<double>& value) { return value ? fmt::format("{:.0f}", *value) : "–"; }

std::string change_of(const std::optional<double>& before, const std::optional<double>& after, const char* unit) {
  if (!before || !after) return "not known";
  return fmt::format("{:.0f} {} before, {:.0f} {} after", *before, unit, *after, unit);
}

/// The row of the table in docs/boards.md.
std::string row_of(const Timing& t, const FlightRecord& record, const std::string& board, const BoardState& after) {
  const ProgramInfo program = program_info();
  return fmt::format("| {} | {} | {:.2f}, {:.2f} | {:.2f}, {:.2f} | {:.0f} | {:.0f} | {} | {} | {} {} |", board,
                     program.simd, t.cpu.track.mean, t.cpu.track.p99, t.cpu.solve.mean, t.cpu.solve.p99,
                     1000 / t.cpu.frame.mean, record.peak_rss_mib, or_dash(after.hottest_c), or_dash(after.clock_mhz),
                     program.version, program.commit);
}

}  // namespace

FlightRecord fly_made_up(double duration_s, const std::function<void(std::size_t, std::size_t)>& progress) {
  const MadeUpFlight flight(duration_s);
  const std::vector<ImuSample> samples = flight.imu_samples();
  const CameraParameters& camera = flight.camera().parameters;
  std::array<std::vector<std::uint8_t>, 2> buffers;  // the tracker still needs the last image
  for (auto& buffer : buffers) buffer.resize(static_cast<std::size_t>(camera.width) * camera.height);
  OfflinePipeline pipeline(settings_of(flight.camera()));
  FlightRecord record;
  record.images_read = flight.images();
  Trajectory truth;
  ImuFeed feed;
  FrameOutcome outcome;
  std::size_t next_imu = 0;
  for (std::size_t k = 0; k < flight.images(); ++k) {
    Frame image;
    image.sequence = k;
    image.stamp = image.arrival = flight.stamp_of_image(k);
    image.data = buffers[k % 2].data();
    image.width = image.stride = camera.width;
    image.height = camera.height;
    flight.draw_image(k, buffers[k % 2].data());
    add_pose(flight.pose_at_image(k), truth);
    if (!pipeline.admit(image)) continue;
    while (feed.wants_more(pipeline.imu_needed_until(image.stamp)) && next_imu < samples.size()) {
      ImuSample sample = samples[next_imu++];
      if (pipeline.add_imu(sample)) feed.took(sample);
    }
    pipeline.step(image, outcome);
    record.images.push_back(image_record(outcome));
    progress(k + 1, flight.images());
  }
  record.truth = std::move(truth);
  record.estimator = pipeline.estimator().stats();
  record.tracker = *pipeline.tracker_stats();
  record.peak_rss_mib = peak_rss_mib();
  return record;
}

Result<double> position_error(const FlightRecord& record) {
  const std::string expected_start = fmt::format("a start within {:.0f} s", kMostStart_s);
  const auto start = start_seconds(record);
  if (!start) return wrong("it did not start", expected_start);
  if (*start > kMostStart_s)
    return wrong(fmt::format("it started {:.1f} s after the first image", *start), expected_start);
  if (coverage(record) != 1.0 || record.images.size() != record.images_read)
    return wrong("images after the start have no pose", "one for each");
  const auto errors = errors_of(record);
  const double error_m = errors->ate_4dof.rmse;
  if (!(error_m <= kMostError_m))  // true of a number that is none, too
    return wrong(fmt::format("its error is {:.3f} m (rms) over {:.1f} m", error_m, errors->path_length_m),
                 fmt::format("at most {:.1f} m", kMostError_m));
  return error_m;
}

std::string bench_text(const FlightRecord& record, double error_m, const std::string& board, const BoardState& before,
                       const BoardState& after) {
  const Timing t = timing_of(record);
  const ProgramInfo program = program_info();
  double tracks = 0;
  for (const ImageRecord& image : record.images) tracks += image.tracks;
  const auto images = static_cast<double>(record.images.size());
  std::string s = fmt::format("computer    {}, {}\nprogram     epiline {} ({}), {}\n", board, program.simd,
                              program.version, program.commit, program.compiler);
  s += fmt::format("flight      {} images of 752 x 480, {:.0f} tracks, {} solves; processor times follow\n",
                   record.images.size(), tracks / images, record.estimator.frames_solved);
  s += fmt::format("track       {:.3f} ms mean, {:.3f} ms 99 %\n", t.cpu.track.mean, t.cpu.track.p99);
  s += fmt::format("solve       {:.3f} ms mean, {:.3f} ms 99 %\n", t.cpu.solve.mean, t.cpu.solve.p99);
  s += fmt::format("image       {:.3f} ms mean, {:.3f} ms 99 %: track, and estimate of every second image\n",
                   t.cpu.frame.mean, t.cpu.frame.p99);
  s += fmt::format("rate        one core does {:.0f} images per second, each with a pose\n", 1000 / t.cpu.frame.mean);
  s += fmt::format("memory      {:.0f} MiB at most\n", record.peak_rss_mib);
  s += fmt::format("temperature {}\n", change_of(before.hottest_c, after.hottest_c, "C"));
  s += fmt::format("clock       {}{}\n", change_of(before.clock_mhz, after.clock_mhz, "MHz"),
                   after.full_clock_mhz ? fmt::format(", {:.0f} MHz at most", *after.full_clock_mhz) : "");
  s += fmt::format("throttling  {}\n", throttling_text(after.throttled));
  s +=
      fmt::format("odometry    right: {:.4f} m rms error over {:.1f} m\n\n", error_m, errors_of(record)->path_length_m);
  return s + row_of(t, record, board, after) + "\n";
}

}  // namespace epiline
