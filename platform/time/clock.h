#pragma once
// Instants and durations in integer nanoseconds. An instant belongs to a clock; code that mixes two clocks does not
// compile.
#include <compare>
#include <cstdint>

namespace epiline {

/// A signed duration.
struct Span {
  std::int64_t ns = 0;
  constexpr auto operator<=>(const Span&) const = default;
  constexpr double seconds() const { return static_cast<double>(ns) * 1e-9; }
  static constexpr Span from_seconds(double s) { return {static_cast<std::int64_t>(s * 1e9 + (s < 0 ? -0.5 : 0.5))}; }
  static constexpr Span from_milliseconds(std::int64_t ms) { return {ms * 1'000'000}; }
};
constexpr Span operator+(Span a, Span b) { return {a.ns + b.ns}; }
constexpr Span operator-(Span a, Span b) { return {a.ns - b.ns}; }
constexpr Span operator-(Span a) { return {-a.ns}; }

/// An instant of the clock domain `Clock`.
template <class Clock>
struct Stamp {
  std::int64_t ns = 0;
  constexpr auto operator<=>(const Stamp&) const = default;
};
template <class C>
constexpr Span operator-(Stamp<C> a, Stamp<C> b) {
  return {a.ns - b.ns};
}
template <class C>
constexpr Stamp<C> operator+(Stamp<C> a, Span d) {
  return {a.ns + d.ns};
}
template <class C>
constexpr Stamp<C> operator-(Stamp<C> a, Span d) {
  return {a.ns - d.ns};
}

struct HostClock {};    ///< the monotonic clock of the computer; in a replay, the recording's common clock
struct DeviceClock {};  ///< the free-running counter of a sensor
using HostStamp = Stamp<HostClock>;
using DeviceStamp = Stamp<DeviceClock>;

}  // namespace epiline
