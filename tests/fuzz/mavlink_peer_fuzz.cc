// Any bytes from a flight controller whose clock is known: no reading that no sensor gives or that is not of the time
// just past, stamps rise, answers are bounded, parameters are numbers of a sensible size, and the clock's model stays
// where honest exchanges put it.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "drivers/links/mavlink/controller_height.h"
#include "drivers/links/mavlink/controller_imu.h"
#include "drivers/links/mavlink/controller_survey.h"
#include "drivers/links/mavlink/imu_request.h"
#include "drivers/links/mavlink/packet.h"
#include "drivers/links/mavlink/timesync.h"

using namespace epiline;
using namespace epiline::mavlink;

namespace {

constexpr std::int64_t kMs = 1'000'000, kAhead_ns = 5'000 * kMs;
constexpr Address kOwn{1, 197}, kAutopilot{1, 1};

void expect(bool condition) {
  if (!condition) std::abort();
}

struct Session {
  std::int64_t now_ns = 1'000'000 * kMs;
  TimesyncExchange timesync{kOwn};
  ControllerImu imu{Span{}};
  ImuRequest request{200};
  HostStamp last;
  ControllerHeight heights{15};
  std::array<HostStamp, kHeightKinds> last_heights;
  ControllerSurvey survey;

  Session() {
    survey.begin(kPx4, now_ns);
    for (int i = 0; i < 20; ++i) {
      const Timesync question = timesync.question(kAutopilot, now_ns);
      timesync.receive({.tc1 = now_ns + kMs + kAhead_ns, .ts1 = question.ts1}, kAutopilot, true, now_ns + 2 * kMs);
      now_ns += 100 * kMs;
    }
  }
  void check(const ImuSample& sample) {
    for (const auto& v : {sample.angular_velocity_rad_s, sample.specific_force_m_s2})
      for (const double x : v) expect(std::abs(x) < 1000);
    expect(sample.stamp > last && sample.stamp.ns > now_ns - 1'000 * kMs && sample.stamp.ns < now_ns + 10 * kMs);
    last = sample.stamp;
  }
  void check(const HeightSample& sample) {
    expect(std::abs(sample.metres) < 1e5);
    HostStamp& before = last_heights[static_cast<std::size_t>(sample.kind)];
    expect(sample.stamp > before && sample.stamp.ns > now_ns - 1'000 * kMs && sample.stamp.ns < now_ns + 10 * kMs);
    before = sample.stamp;
  }
  void receive(const Packet& packet) {
    now_ns += kMs / 10;
    Timesync t;
    HighresImu highres;
    RawImu raw;
    CommandAck answer;
    ImuSample sample;
    if (unpack(packet, t)) timesync.receive(t, packet.from, true, now_ns);
    if (unpack(packet, highres) && imu.take(highres, timesync.clock(), HostStamp{now_ns}, sample)) check(sample);
    if (unpack(packet, raw) && imu.take(raw, timesync.clock(), HostStamp{now_ns}, sample)) check(sample);
    HeightSample height;
    if (ControllerHeight::is_mine(packet) && heights.take(packet, timesync.clock(), HostStamp{now_ns}, height))
      check(height);
    if (unpack(packet, answer)) request.receive(answer, kOwn, now_ns);
    if (survey.receive(packet, now_ns))
      for (const float v : survey.answers().parameters) expect(std::isnan(v) || std::abs(v) < 1e9F);
    while (const auto owed = timesync.answer(now_ns)) expect(owed->tc1 == now_ns);
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Session session;
  Parser parser;
  std::span<const std::uint8_t> bytes(data, size);
  while (const Packet* packet = parser.next(bytes)) session.receive(*packet);
  // bytes that were made before the clock was asked cannot answer it
  const std::int64_t off_ns = session.timesync.clock().state().offset.ns + kAhead_ns;
  expect(std::abs(off_ns) <= kMs && session.timesync.clock().state().jumps == 0);
  return 0;
}
