#include "drivers/program/cli/record_lines.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "drivers/program/cli/say.h"

namespace epiline {

namespace {

double megabytes(double bytes) { return 1e-6 * bytes; }

std::string time_text(double seconds) {
  if (!(seconds < 1e7)) return "any time";
  if (seconds < 120) return fmt::format("{:.0f} s", seconds);
  return seconds < 7200 ? fmt::format("{:.0f} minutes", seconds / 60) : fmt::format("{:.1f} hours", seconds / 3600);
}

/// Says how long the disk lasts, and when images or samples begin to be lost, with a line each. On a terminal, another
/// line is overwritten once a second.
class RecordLines {
 public:
  explicit RecordLines(bool says) : says_(says), terminal_(says && isatty(STDERR_FILENO) == 1) {}
  ~RecordLines() { clear(); }
  RecordLines(const RecordLines&) = delete;
  RecordLines& operator=(const RecordLines&) = delete;

  void operator()(const RecordState& state) {
    if (!says_) return;
    if (!room_said_ && state.bytes_per_s > 0) say_room(state);
    if (state.seconds - said_s_ < 1) return;
    said_s_ = state.seconds;
    say_silence(state.camera_silent_s, "the camera", camera_is_silent_);
    say_silence(state.imu_silent_s, "the IMU", imu_is_silent_);
    if (state.counts.lost() > lost_) {
      for (const std::string& line : loss_lines(state)) say("lost so far: " + line);
      lost_ = state.counts.lost();
    }
    if (terminal_) show(state);
  }

 private:
  void clear() {
    if (shown_) epiline::say(stderr, "\r\x1b[K");
    shown_ = false;
  }
  void say(const std::string& text) {
    clear();
    epiline::say("{:9.2f} s  {}\n", said_s_, text);
  }
  void say_room(const RecordState& state) {
    room_said_ = true;
    clear();
    epiline::say("room      for {} at {:.1f} MB/s\n", time_text(state.seconds_left), megabytes(state.bytes_per_s));
  }
  void say_silence(double silent_s, const char* who, bool& was_silent) {
    constexpr double kLong_s = 1.5;
    const bool is_silent = silent_s > kLong_s;
    if (is_silent != was_silent) say(fmt::format("{} {}", who, is_silent ? "is silent" : "delivers again"));
    was_silent = is_silent;
  }
  void show(const RecordState& s) {
    clear();
    epiline::say(stderr,
                 "{:9.2f} s  {} images ({:.1f} Hz), {} IMU samples ({:.0f} Hz), {} lost, {:.0f} MB, room for {}",
                 s.seconds, s.counts.images, s.image_rate_hz, s.counts.readings, s.reading_rate_hz, s.counts.lost(),
                 megabytes(static_cast<double>(s.bytes)), time_text(s.seconds_left));
    shown_ = true;
  }

  bool says_, terminal_, shown_ = false, room_said_ = false, camera_is_silent_ = false, imu_is_silent_ = false;
  double said_s_ = 0;
  std::uint64_t lost_ = 0;
};

std::string end_text(RecordEnd end, double keep_free_mb) {
  if (end == RecordEnd::kDiskFull)
    return fmt::format("because the disk is full but for {:.0f} MB (--keep-free)", keep_free_mb);
  constexpr const char* kWhy[] = {"as asked", "after the duration asked for", "as camera and IMU give no more", "", ""};
  return kWhy[static_cast<std::size_t>(end)];
}

void print_summary(const RecordSummary& summary, const RecordOptions& options) {
  const RecordState& s = summary.last;
  const double bytes = static_cast<double>(s.bytes);
  epiline::say("ended     {}, after {:.1f} s\n",
               end_text(summary.end, 1e-6 * static_cast<double>(options.keep_free_bytes)), s.seconds);
  epiline::say("images    {} written, {} lost\n", s.counts.images,
               s.counts.images_missed + s.counts.images_unwritten + s.counts.images_old + s.counts.images_resized);
  epiline::say("samples   {} IMU samples written, {} lost\n", s.counts.readings,
               s.counts.readings_missed + s.counts.readings_unwritten);
  epiline::say("size      {:.1f} MB, {:.0f} MB a minute\n", megabytes(bytes), 60 * megabytes(bytes) / s.seconds);
  for (const std::string& line : loss_lines(s)) epiline::say("lost      {}\n", line);
  for (const DeviceRecord& device : summary.devices) {
    for (const DeviceCount& c : device.counts)
      if (c.is_fault && c.value > 0) epiline::say("fault     {}: {} {}\n", device.name, c.name, c.value);
  }
  epiline::say("written   {}\n", options.out.string());
}

}  // namespace

Result<RecordSummary> record_and_say(const std::filesystem::path& config, const std::vector<std::string>& set,
                                     const RecordOptions& options, bool says) {
  const auto settings = read_live_settings(config, set, CalibrationNeed::kIfGiven);
  if (!settings) return settings.error();
  auto devices = make_sensors(*settings);
  if (!devices) return devices.error();
  auto summary = [&] {
    RecordLines lines(says);
    return record(*settings, *devices, options, [&](const RecordState& state) {
      lines(state);
      return true;
    });
  }();
  if (summary && says) print_summary(*summary, options);
  return summary;
}

}  // namespace epiline
