#include "pipeline/realtime/flight_log.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/stages/estimator_events.h"
#include "pipeline/stages/load_governor.h"
#include "platform/memory/allocation_count.h"

namespace epiline {
namespace {

using Speaker = FlightLog::Speaker;
constexpr HostStamp kEnd{std::numeric_limits<std::int64_t>::max()};

std::int64_t no_clock() noexcept { return 0; }

struct Notes final : FlightObserver {
  explicit Notes(bool images = false) : wants(images) { events.reserve(10000); }
  void take(const FrameOutcome& o) noexcept override { outcome = o.serial; }
  void published(std::uint64_t serial, std::int64_t latency_ns) noexcept override {
    publication = serial;
    latency = latency_ns;
  }
  void imu(const ImuSample& sample) noexcept override {
    in_order &= sample.stamp > last_imu;
    last_imu = sample.stamp;
    ++readings;
  }
  void wheel(const WheelSample& sample) noexcept override { speed_m_s += sample.forward_speed_m_s; }
  void tracks(const LoggedTracks& t) noexcept override {
    EXPECT_EQ(t.serial, outcome) << "an image's outcome comes before its tracks";
    points = t.points.size();
    if (points > 0) last_point = t.points.back();
  }
  void image(const Frame& frame, const OtherFrames& others) noexcept override {
    image_pixel = *frame.data;
    second_pixel = others[0].data == nullptr ? -1 : *others[0].data;
  }
  void event(const Event& event) noexcept override { events.push_back(event); }
  void pass(HostStamp /*now*/) noexcept override { ++passes; }
  bool wants_images() const noexcept override { return wants; }

  bool wants, in_order = true;
  std::uint64_t outcome = 99, publication = 99;
  std::int64_t latency = 0;
  HostStamp last_imu{-1};
  int readings = 0, image_pixel = -1, second_pixel = -2, passes = 0;
  double speed_m_s = 0;
  std::size_t points = 0;
  LoggedPoint last_point;
  std::vector<Event> events;
};

class FlightLogTest : public testing::Test {
 protected:
  void make(int images, std::vector<EventRing*> more = {}) {
    log = std::make_unique<FlightLog>(std::vector<FlightObserver*>{&one, &two}, std::move(more), images);
  }
  void tell(Speaker speaker, std::int64_t at) { log->events_of(speaker).push({HostStamp{at}, EventId::kReset, {}}); }
  std::vector<std::int64_t> times(const Notes& notes) const {
    std::vector<std::int64_t> t;
    for (const Event& e : notes.events) t.push_back(e.stamp.ns);
    return t;
  }

  Notes one, two{true};
  LentImages lent{nullptr};
  std::unique_ptr<FlightLog> log;
};

TEST_F(FlightLogTest, EachObserverGetsEveryStreamAndNoHeapIsUsed) {
  make(2);
  FrameOutcome outcome;
  outcome.serial = 5;
  LoggedTracks tracked;
  tracked.serial = 5;
  tracked.points.push_back({3, 1, 1.5F, 2.5F});
  tracked.points.push_back({7, 4, -3.25F, 8});
  const std::uint8_t pixel = 77, second_pixel = 78;
  const Frame frame{HostStamp{0}, 12, &pixel, 1, 1, 1, 0};
  const HeapCallScope heap;
  lent.lend(frame, {Frame{HostStamp{0}, 13, &second_pixel, 1, 1, 1, 0}});
  for (std::int64_t i = 0; i < 100; ++i) log->imu().push({HostStamp{i}, {}, {}});
  log->wheel().push({HostStamp{0}, 1.5, 0});
  log->wheel().push({HostStamp{1}, 2, 0});
  EXPECT_TRUE(log->outcomes().push(outcome));
  EXPECT_TRUE(log->tracks().push(tracked));
  log->publications().push({5, 42});
  EXPECT_TRUE(log->images().push(frame));
  EXPECT_FALSE(log->empty());
  log->drain(HostStamp{0}, HostStamp{0}, lent);
  EXPECT_EQ(heap.calls(), 0);
  EXPECT_TRUE(log->empty());
  for (const Notes* n : {&one, &two}) {
    EXPECT_EQ(n->readings, 100);
    EXPECT_EQ(n->speed_m_s, 3.5);
    EXPECT_TRUE(n->in_order);
    EXPECT_EQ(n->outcome, 5u);
    EXPECT_EQ(n->publication, 5u);
    EXPECT_EQ(n->latency, 42);
    ASSERT_EQ(n->points, 2u);
    EXPECT_EQ(n->last_point.id, 7u);
    EXPECT_EQ(n->last_point.age, 4u);
    EXPECT_EQ(n->last_point.u, -3.25F);
    EXPECT_EQ(n->passes, 1);
  }
  EXPECT_EQ(two.image_pixel, 77);
  EXPECT_EQ(two.second_pixel, 78);
  EXPECT_EQ(lent.users(0), 0u);
  EXPECT_EQ(one.image_pixel, -1) << "who wants no image gets none";
}

TEST_F(FlightLogTest, HoldsNoMoreImagesThanItMay) {
  make(2);
  const std::uint8_t pixel = 0;
  const Frame frame{HostStamp{0}, 0, &pixel, 1, 1, 1, 0};
  lent.lend(frame);
  lent.share(0);
  EXPECT_TRUE(log->images().push(frame));
  EXPECT_TRUE(log->images().push(frame));
  EXPECT_FALSE(log->images().push(frame));
  log->drain(HostStamp{0}, kEnd, lent);
  EXPECT_EQ(lent.users(0), 0u);
  EXPECT_EQ(two.second_pixel, -1) << "no second camera, no second image";
  EXPECT_TRUE(log->images().push(frame));
  EXPECT_EQ(log->images_skipped(), 1u);
  ASSERT_EQ(one.events.size(), 1u);
  EXPECT_EQ(one.events[0].id, EventId::kRingOverflow);
  EXPECT_EQ(one.events[0].args[0], static_cast<std::int64_t>(RingName::kImagesToLog));
  two.wants = false;
  make(2);
  EXPECT_FALSE(log->images().wanted());
  EXPECT_FALSE(log->images().push(frame)) << "nobody wants one";
}

TEST_F(FlightLogTest, EventsOfSeveralThreadsComeInTheOrderOfTime) {
  auto watchdog = std::make_unique<EventRing>();
  make(0, {watchdog.get()});
  tell(Speaker::kTrack, 30);
  tell(Speaker::kTrack, 50);
  tell(Speaker::kEstimate, 10);
  log->drain(HostStamp{60}, HostStamp{20}, lent);
  EXPECT_EQ(times(one), (std::vector<std::int64_t>{10}));
  watchdog->push({HostStamp{40}, EventId::kClockJump, {}});
  tell(Speaker::kImu, 25);  // comes late, and finds its place
  log->drain(HostStamp{90}, HostStamp{45}, lent);
  EXPECT_EQ(times(one), (std::vector<std::int64_t>{10, 25, 30, 40}));
  tell(Speaker::kImu, 5);  // too late: goes on at once
  log->drain(HostStamp{90}, HostStamp{45}, lent);
  EXPECT_EQ(times(one).back(), 5);
  log->drain(HostStamp{90}, kEnd, lent);
  EXPECT_EQ(times(two), (std::vector<std::int64_t>{10, 25, 30, 40, 5, 50}));
}

TEST_F(FlightLogTest, AFullRingIsAnEventAndMoreEventsThanItCanHoldBackGoOnEarly) {
  make(0);
  for (std::int64_t i = 0; i < 1100; ++i) tell(Speaker::kImu, i);
  for (std::int64_t i = 0; i < 5000; ++i) log->imu().push({HostStamp{i}, {}, {}});
  log->note_lost(RingName::kImuToTrack, 7, HostStamp{3});
  log->drain(HostStamp{3}, HostStamp{-1}, lent);
  EXPECT_EQ(one.readings, 4096);
  EXPECT_TRUE(one.events.empty());
  for (int round = 0; round < 4; ++round) {
    for (std::int64_t i = 0; i < 1000; ++i) tell(Speaker::kImu, 2000 + i);
    log->drain(HostStamp{3}, HostStamp{-1}, lent);
  }
  EXPECT_GT(one.events.size(), 900u);  // 5027 events, 4096 places
  log->drain(HostStamp{3}, kEnd, lent);
  EXPECT_EQ(one.events.size(), 1024u + 3 + 4000);
  EXPECT_EQ(log->events_dropped(), 76u);
  std::int64_t lost[static_cast<int>(RingName::kCount)] = {};
  for (const Event& e : one.events) {
    if (e.id == EventId::kRingOverflow) lost[e.args[0]] += e.args[1];
  }
  EXPECT_EQ(lost[static_cast<int>(RingName::kImuToTrack)], 7);
  EXPECT_EQ(lost[static_cast<int>(RingName::kImuToLog)], 5000 - 4096);
  EXPECT_EQ(lost[static_cast<int>(RingName::kEvents)], 76);
}

TEST(EstimatorEvents, TellOfAGapInTheReadings) {
  const EstimatorConfig config;
  BackEnd back_end(config, {no_clock, no_clock}, 0);
  auto ring = std::make_unique<EventRing>();
  EstimatorEvents events(*ring);
  const auto add = [&](std::int64_t ms) {
    const ImuSample sample{HostStamp{ms * 1'000'000}, {}, {0, 0, 9.81}};
    back_end.add_imu(sample);
    events.after_imu(sample, back_end);
  };
  for (std::int64_t ms = 0; ms <= 1000; ms += 5) add(ms);
  Event event;
  EXPECT_FALSE(ring->pop(event));
  add(1600);  // so far ahead that the next one must confirm it
  EXPECT_FALSE(ring->pop(event));
  add(1605);
  ASSERT_TRUE(ring->pop(event));
  EXPECT_EQ(event.id, EventId::kImuGap) << to_string(event.id);
  EXPECT_EQ(event.stamp.ns, 1'605'000'000);
  EXPECT_EQ(event.args[0], 605'000'000);
  EXPECT_FALSE(ring->pop(event));
}

TEST(EstimatorEvents, LoadLevelsAndStartsAreShownByName) {
  char text[128];
  const auto shown = [&](const Event& event) { return std::string(text, format_event(event, text)); };
  EXPECT_EQ(shown(make_event({}, EventId::kLoadLevel, LoadLevel::kFull, LoadLevel::kPredictionOnly)),
            "0.000000000 load_level from=full to=prediction_only");
  EXPECT_EQ(shown(make_event({}, EventId::kStarted, StartKind::kCarried)), "0.000000000 started kind=carried");
}

}  // namespace
}  // namespace epiline
