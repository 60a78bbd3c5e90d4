#include "platform/log/event.h"

#include <algorithm>
#include <cinttypes>
#include <cstdarg>
#include <cstdio>
#include <iterator>

#include "platform/log/suspicion_names.h"
#include "platform/samples/samples.h"

namespace epiline {
namespace {

// The names of an enumeration's values, in its order. Those of the estimator's words are compared with it by a test.
using Names = std::span<const char* const>;
constexpr const char* kStartKinds[] = {"none", "given", "stationary", "moving", "carried"};
constexpr const char* kSources[] = {"camera", "imu", "wheel", "height", "odometry"};
constexpr const char* kImageLosses[] = {"overtaken", "missed", "refused"};
constexpr const char* kImuRefusals[] = {"out_of_order", "duplicate", "not_finite", "other_time", "impossible"};
constexpr const char* kRings[] = {
    "frames",        "imu_to_track", "imu_to_estimate",   "imu_to_publish", "tracked",
    "knowledge",     "outcomes",     "publications",      "tracks_to_log",  "imu_to_log",
    "images_to_log", "events",       "wheel_to_estimate", "wheel_to_log",   "height_to_estimate",
    "height_to_log"};
static_assert(std::size(kRings) == static_cast<std::size_t>(RingName::kCount));

enum class Shown : std::uint8_t { kNumber, kName, kBits };

struct Argument {
  const char* name = nullptr;  ///< null: not used
  Shown shown = Shown::kNumber;
  Names names;
};
constexpr Argument number(const char* name) { return {name, Shown::kNumber, {}}; }
constexpr Argument one_of(const char* name, Names names) { return {name, Shown::kName, names}; }
constexpr Argument bits(const char* name, Names names) { return {name, Shown::kBits, names}; }

struct Description {
  const char* name;
  std::array<Argument, 3> arguments;
};

constexpr Description kDescriptions[] = {
    {"image_dropped", {number("sequence"), one_of("reason", kImageLosses), number("images")}},
    {"imu_late", {number("waited_ms")}},
    {"imu_gap", {number("length_ns")}},
    {"imu_refused", {number("on"), number("readings"), one_of("reason", kImuRefusals)}},
    {"imu_saturated", {number("on"), number("readings")}},
    {"deadline_missed", {number("sequence"), number("late_ns")}},
    {"started", {one_of("kind", kStartKinds)}},
    {"health_changed",
     {one_of("from", kHealthStateNames), one_of("to", kHealthStateNames), bits("reasons", kHealthReasonNames)}},
    {"reset", {number("count")}},
    {"source_lost", {one_of("source", kSources)}},
    {"source_found", {one_of("source", kSources)}},
    {"clock_jump", {one_of("source", kSources), number("correction_ns")}},
    {"images_frozen", {number("on"), number("images")}},
    {"lens_covered", {number("on"), number("images")}},
    {"images_repeated", {number("on"), number("images")}},
    {"imu_in_bursts", {number("readings")}},
    {"load_level", {one_of("from", kLoadLevelNames), one_of("to", kLoadLevelNames)}},
    {"ring_overflow", {one_of("ring", kRings), number("lost")}},
    {"record_written", {number("number"), one_of("reason", kRecordReasonNames)}},
    {"record_failed", {number("number"), one_of("reason", kRecordReasonNames), number("errno")}},
    {"number_wrong", {one_of("what", kSuspectNames), one_of("severity", kSeverityNames), number("figure")}},
    {"other_camera_blind", {number("on"), number("images"), number("camera")}},
};
static_assert(std::size(kDescriptions) == static_cast<std::size_t>(EventId::kCount));

// A text that is cut where the room ends.
struct Cut {
  std::span<char> room;
  std::size_t used = 0;

  [[gnu::format(printf, 2, 3)]] void print(const char* format, ...) noexcept {
    std::va_list arguments;
    va_start(arguments, format);
    const int wanted = std::vsnprintf(room.data() + used, room.size() - used, format, arguments);
    va_end(arguments);
    if (wanted > 0) used = std::min(used + static_cast<std::size_t>(wanted), room.size() - 1);
  }
};

// `a+b`; `none` without a bit; bits without a name as one number.
void print_bits(Cut& out, std::uint64_t value, Names names) noexcept {
  if (value == 0) return out.print("none");
  const char* between = "";
  for (std::size_t i = 0; i < names.size(); ++i) {
    if ((value >> i & 1) == 0) continue;
    out.print("%s%s", between, names[i]);
    between = "+";
    value &= ~(std::uint64_t{1} << i);
  }
  if (value != 0) out.print("%s%" PRIu64, between, value);
}

void print_value(Cut& out, const Argument& argument, std::int64_t value) noexcept {
  if (argument.shown == Shown::kBits) return print_bits(out, static_cast<std::uint64_t>(value), argument.names);
  const auto index = static_cast<std::size_t>(value);
  if (argument.shown == Shown::kName && index < argument.names.size()) return out.print("%s", argument.names[index]);
  out.print("%" PRId64, value);
}

}  // namespace

const char* to_string(RingName ring) noexcept {
  const auto index = static_cast<std::size_t>(ring);
  return index < std::size(kRings) ? kRings[index] : "unknown";
}

const char* to_string(EventId id) noexcept {
  const auto index = static_cast<std::size_t>(id);
  return index < std::size(kDescriptions) ? kDescriptions[index].name : "unknown";
}

std::size_t format_event(const Event& event, std::span<char> text) noexcept {
  if (text.empty()) return 0;
  Cut out{text};
  constexpr std::uint64_t kSecond = 1'000'000'000;
  const bool negative = event.stamp.ns < 0;
  const auto ns = static_cast<std::uint64_t>(event.stamp.ns);
  const std::uint64_t magnitude = negative ? 0 - ns : ns;  // unsigned: also the smallest number has one
  out.print("%s%" PRIu64 ".%09" PRIu64 " %s", negative ? "-" : "", magnitude / kSecond, magnitude % kSecond,
            to_string(event.id));
  const auto index = static_cast<std::size_t>(event.id);
  if (index >= std::size(kDescriptions)) {
    out.print(" id=%zu", index);
    return out.used;
  }
  for (std::size_t i = 0; i < event.args.size(); ++i) {
    const Argument& argument = kDescriptions[index].arguments[i];
    if (argument.name == nullptr) continue;
    out.print(" %s=", argument.name);
    print_value(out, argument, event.args[i]);
  }
  return out.used;
}

}  // namespace epiline
