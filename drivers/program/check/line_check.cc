#include "drivers/program/check/line_check.h"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cmath>

namespace epiline {

namespace {

constexpr Span kLineWait = Span::from_milliseconds(100);
constexpr double kLargeLag = 0.35;      // of a period; from half of it on an image takes its neighbour's edge
constexpr std::uint64_t kOddMost = 50;  // of so many edges one may be missing or too soon
constexpr const char* kNoEdges =
    "check that the sender is on, wired to this line (gpioinfo), and at the board's voltage";

std::string rate_and_line(double period_s, const std::string& line) {
  return fmt::format("{:.2f} edges per second on {}", period_s > 0 ? 1 / period_s : 0, line);
}

}  // namespace

Status LineCheck::open() {
  const Status opened = line_.open();
  if (opened) thread_.emplace([this] { return look(); });
  return opened;
}

bool LineCheck::look() {
  std::array<HostStamp, 64> edges;
  std::size_t count = 0;
  if (line_.read(edges, count, kLineWait) == ReadOutcome::kFailed)
    std::this_thread::sleep_for(std::chrono::nanoseconds(kLineWait.ns));
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < count; ++i) pacing_.step(edges[i], {});
  return true;
}

PacingResult LineCheck::so_far() {
  const std::lock_guard lock(mutex_);
  return pacing_.result();
}

Findings findings_of(const PacingResult& edges, const std::string& device, const std::string& line) {
  Findings out;
  const DeviceFindings say(device, out);
  if (edges.samples < 2)
    say.warn(fmt::format("{} edges on {}", edges.samples, line), kNoEdges);
  else
    say.ok(fmt::format("{}, jitter {:.3f} ms", rate_and_line(edges.period_s, line), 1e3 * edges.jitter_s));
  return out;
}

Findings findings_of(const EdgeCounts& e, const GpioCounts& counts, const std::string& line) {
  Findings out;
  const DeviceFindings say("camera", out);
  if (counts.disconnected > 0)
    say.error(fmt::format("the GPIO chip of {} disappeared{}", line, counts.last_error == 0 ? ", and returned" : ""),
              "check its cable, supply and driver");
  if (e.edges == 0) {
    say.error(fmt::format("no edges on {}: no image gets a timestamp", line), kNoEdges);
    return out;
  }
  const std::uint64_t judged = e.matched + e.without_edge + e.mismatched;
  say.judge(fmt::format("{}, matched to {} of {} images; the driver's timestamps are {:.2f} ms later",
                        rate_and_line(e.period.seconds(), line), e.matched, judged + e.unsure, 1e3 * e.lag.seconds()),
            {{judged == 0 || 2 * e.matched < judged, Grade::kError,
              "it needs one edge per exposure: check the trigger's rate, camera.stamp_edge, and bouncing"},
             {std::abs(e.lag.seconds()) > kLargeLag * e.period.seconds(), Grade::kWarning,
              "near half a period an image takes its neighbour's edge: correct camera.readout_ms, exposure_ms or "
              "stamp_point"}});
  if ((e.missing + e.extra) * kOddMost > e.edges)
    say.warn(fmt::format("{} edges missing on {}, {} too early", e.missing, line, e.extra),
             "use a steady trigger, a shorter wire or a pull-up; avoid bouncing contacts");
  return out;
}

}  // namespace epiline
