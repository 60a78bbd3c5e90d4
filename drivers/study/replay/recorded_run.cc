#include "drivers/study/replay/recorded_run.h"

#include <fmt/format.h>

#include "drivers/flights/recordings/image_codecs.h"
#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"

namespace epiline {

namespace {

std::string png_of_frame(const Frame& frame) {
  return png_of(GreyPixels{frame.data, frame.width, frame.height, frame.stride});
}

void count_costs(const RealtimeReport& report, FlightRecord& record) {
  std::uint64_t heap = 0, locks = 0;
  for (const RealtimeReport::Thread& t : report.threads) {
    heap += t.costs.heap_calls;
    locks += t.costs.lock_calls;
    record.page_faults += t.costs.page_faults;
  }
  if (allocation_counting_available()) record.heap_calls = heap;
  if (lock_counting_available()) record.lock_calls = locks;
}

}  // namespace

RecordedRun recorded_run(const CameraParameters& camera,
                         const std::array<std::optional<CameraParameters>, kMostOthers>& others, double image_rate_hz,
                         const ImuCorrection& correction, Config config) {
  RecordedRun run;
  run.camera = {camera, config.estimator.extrinsics.R_BC, config.estimator.extrinsics.p_BC,
                config.estimator.extrinsics.time_offset_s};
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    const OtherCamera& mounted = config.estimator.others[i];
    // the stamps of its images are those of the first one
    if (others[i]) run.others[i] = {*others[i], mounted.R_BC, mounted.p_BC, run.camera.time_offset_s};
  }
  run.image_rate_hz = image_rate_hz;
  run.imu = {config.estimator.imu, config.estimator.saturation_gyroscope_rad_s,
             config.estimator.saturation_accelerometer_m_s2, correction};
  config.camera_calibration = config.imu_calibration = config.recorder.folder = "";
  run.config_toml = to_toml(config);
  run.png = png_of_frame;
  return run;
}

std::vector<std::string> shortfalls_of(const RealtimeReport& report) {
  std::vector<std::string> lines;
  std::string without;
  for (const RealtimeReport::Thread& t : report.threads) {
    if (t.shortfall.priority) without += fmt::format("{}{}", without.empty() ? "" : ", ", t.name);
    if (t.shortfall.cpu)
      lines.push_back(fmt::format("the thread {0} could not be bound to its processor (realtime.cpu_{0})", t.name));
  }
  if (!without.empty())
    lines.push_back("no real-time priority for " + without +
                    ": not permitted (run as root, or raise LimitRTPRIO or ulimit -r)");
  if (!report.memory_not_locked.empty())
    lines.push_back("memory is not locked: " + report.memory_not_locked +
                    " (run as root, or raise LimitMEMLOCK or ulimit -l)");
  return lines;
}

void take_report(const RealtimePipeline& pipeline, double speed, FlightRecord& record) {
  const RealtimeReport report = pipeline.report();
  record.events_lost += report.events_dropped;
  record.threads = static_cast<int>(report.threads.size());
  record.estimator = pipeline.estimator().stats();
  if (const TrackerStats* tracker = pipeline.tracker_stats()) record.tracker = *tracker;
  for (std::size_t c = 1; c <= kMostOthers; ++c)
    if (const SecondStats* other = pipeline.other_stats(c)) record.others[c - 1] = *other;
  record.imu_read = report.imu_in;
  record.imu_watch = report.imu_watch;
  record.image_watch = report.image_watch;
  record.skipped["refused_by_estimator"] = record.estimator.frames_refused;
  record.skipped["refused_by_watch"] = report.frames_refused;
  record.skipped["overtaken"] = report.frames_overtaken;
  count_costs(report, record);
  record.load = report.load;
  record.realtime = RealtimeRecord{speed, shortfalls_of(report), report, std::nullopt, std::nullopt, {}, {}};
}

void finish(FlightRecorder& recorder, FlightRecord& record) {
  recorder.finish(true);
  for (Event event; recorder.events().pop(event);) record.events.push_back(event);
  record.realtime->recorder = recorder.report();
}

}  // namespace epiline
