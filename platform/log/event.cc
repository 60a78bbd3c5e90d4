#include "platform/log/event.h"

#include <algorithm>
#include <cinttypes>
#include <cstdarg>
#include <cstdio>
#include <iterator>

namespace epiline {
namespace {

struct Description {
  const char* name;
  std::array<const char*, 3> arguments;  ///< null: not used
};

constexpr Description kDescriptions[] = {
    {"image_dropped", {"sequence", "reason", nullptr}}, {"imu_gap", {"length_ns", nullptr, nullptr}},
    {"imu_refused", {"reason", nullptr, nullptr}},      {"deadline_missed", {"sequence", "late_ns", nullptr}},
    {"health_changed", {"from", "to", "reasons"}},      {"reset", {"count", nullptr, nullptr}},
    {"source_lost", {"source", "errno", nullptr}},      {"source_found", {"source", nullptr, nullptr}},
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

}  // namespace

std::size_t format_event(const Event& event, std::span<char> text) noexcept {
  if (text.empty()) return 0;
  Cut out{text};
  constexpr std::uint64_t kSecond = 1'000'000'000;
  const bool negative = event.stamp.ns < 0;
  const auto ns = static_cast<std::uint64_t>(event.stamp.ns);
  const std::uint64_t magnitude = negative ? 0 - ns : ns;  // unsigned: also the smallest number has one
  out.print("%s%" PRIu64 ".%09" PRIu64 " ", negative ? "-" : "", magnitude / kSecond, magnitude % kSecond);
  const auto index = static_cast<std::size_t>(event.id);
  if (index >= std::size(kDescriptions)) {
    out.print("unknown id=%zu", index);
    return out.used;
  }
  out.print("%s", kDescriptions[index].name);
  for (std::size_t i = 0; i < event.args.size(); ++i) {
    const char* const argument = kDescriptions[index].arguments[i];
    if (argument != nullptr) out.print(" %s=%" PRId64, argument, event.args[i]);
  }
  return out.used;
}

}  // namespace epiline
