// The promise of SendSchedule, over made-up time: no gap above 1.5 periods, no rate above 1.1, images at once where
// their rate leaves room for it.
#include "drivers/links/stream/send_schedule.h"
#include "tests/support/times.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <vector>

namespace epiline {
namespace {

struct Sent {
  std::vector<std::int64_t> sent_ns;
  std::vector<std::int64_t> image_delay_ns;  ///< from the first prediction with an image in it to its message
};

/// The link's use of it: a prediction every `imu_ns`, an image in it every `image_ns` (0: none) or up to `jitter_ns`
/// later.
Sent simulate(double rate_hz, std::int64_t imu_ns, std::int64_t image_ns, std::int64_t jitter_ns, std::int64_t end_ns) {
  SendSchedule schedule(rate_hz);
  Sent run;
  bool has_unsent = false, has_image = false;
  std::int64_t image_came_ns = 0, next_image_ns = image_ns, seed = 1;
  constexpr std::int64_t kStep_ns = kMs / 10;
  const std::int64_t start_ns = 1'000'000 * kMs;
  for (std::int64_t t = 0; t < end_ns; t += kStep_ns) {
    const std::int64_t now_ns = start_ns + t;
    if (t % imu_ns == 0) {
      has_unsent = true;
      if (image_ns > 0 && t >= next_image_ns) {
        seed = (seed * 1103515245 + 12345) % 2147483648;
        next_image_ns = (t / image_ns + 1) * image_ns + (jitter_ns > 0 ? seed % jitter_ns : 0);
        schedule.image(now_ns);
        if (!has_image) image_came_ns = now_ns;
        has_image = true;
      }
    }
    if (!has_unsent || now_ns < schedule.due_ns(has_image)) continue;
    schedule.sent(now_ns);
    run.sent_ns.push_back(now_ns);
    if (has_image) run.image_delay_ns.push_back(now_ns - image_came_ns);
    has_unsent = has_image = false;
  }
  return run;
}

/// Of the run's second half, when the images' interval is known.
double rate_of(const Sent& run) {
  const std::size_t half = run.sent_ns.size() / 2;
  return 1e9 * static_cast<double>(run.sent_ns.size() - 1 - half) /
         static_cast<double>(run.sent_ns.back() - run.sent_ns[half]);
}

/// `late`: in periods, for the steps of the made-up time.
bool keeps_promises(const Sent& run, double rate_hz, double late = 1e-6) {
  return std::adjacent_find(run.sent_ns.begin(), run.sent_ns.end(), [&](std::int64_t a, std::int64_t b) {
           const double periods = static_cast<double>(b - a) * 1e-9 * rate_hz;
           return periods > 1.5 + late || periods < 1 / 1.1 - 1e-6;
         }) == run.sent_ns.end();
}

TEST(SendSchedules, WithoutImagesMessagesAreEven) {
  const Sent run = simulate(40, 5 * kMs, 0, 0, 10'000 * kMs);
  EXPECT_TRUE(keeps_promises(run, 40));
  EXPECT_NEAR(rate_of(run), 40, 0.1);
}

// One image tells nothing about when the next one comes: after the first, and after the first of a pause.
TEST(SendSchedules, AfterASingleImageMessagesAreEven) {
  SendSchedule schedule(40);
  std::int64_t now_ns = 1'000'000 * kMs;
  for (const std::int64_t pause_ns : {0 * kMs, 2'000 * kMs}) {
    now_ns += pause_ns;
    schedule.sent(now_ns);
    schedule.image(now_ns + 10 * kMs);
    EXPECT_EQ(schedule.due_ns(false), now_ns + 25 * kMs) << pause_ns;
    for (int i = 1; i < 7; ++i) schedule.image(now_ns + (10 + 40 * i) * kMs);
    now_ns += 260 * kMs;
    schedule.sent(now_ns);
    EXPECT_GT(schedule.due_ns(false), now_ns + 30 * kMs) << "when the next image is expected";
  }
}

// Images that leave room for the rate go at once; messages between are laid around them.
TEST(SendSchedules, ImagesGoAtOnceWhereTheRateAllows) {
  struct Case {
    double rate_hz;
    std::int64_t image_ns;
    double expected_hz;
  };
  for (const Case& c :
       {Case{40, 50 * kMs, 40}, Case{40, 100 * kMs, 40}, Case{40, 30 * kMs, 33.33}, Case{50, 20 * kMs, 50}}) {
    SCOPED_TRACE(testing::Message() << c.rate_hz << " Hz, images every " << c.image_ns / kMs << " ms");
    const Sent run = simulate(c.rate_hz, 5 * kMs, c.image_ns, 0, 10'000 * kMs);
    EXPECT_TRUE(keeps_promises(run, c.rate_hz));
    EXPECT_NEAR(rate_of(run), c.expected_hz, 0.1);
    const auto half = run.image_delay_ns.begin() + static_cast<long>(run.image_delay_ns.size() / 2);
    EXPECT_EQ(*std::max_element(half, run.image_delay_ns.end()), 0);
  }
}

// Images that come a few milliseconds late find room all the same: what would fill the gap waits for them a little.
TEST(SendSchedules, LateImagesGoAtOnce) {
  for (const std::int64_t image_ns : {50 * kMs, 30 * kMs}) {
    const Sent run = simulate(40, 1 * kMs, image_ns, 4 * kMs, 10'000 * kMs);
    EXPECT_TRUE(keeps_promises(run, 40));
    const auto at_once = std::count_if(run.image_delay_ns.begin(), run.image_delay_ns.end(),
                                       [](std::int64_t delay) { return delay <= 1 * kMs; });
    EXPECT_GE(static_cast<double>(at_once), 0.9 * static_cast<double>(run.image_delay_ns.size())) << image_ns / kMs;
  }
}

// Whatever the rates and the jitter.
RC_GTEST_PROP(SendSchedules, KeepsItsPromises, ()) {
  const int rate_hz = *rc::gen::inRange(10, 101);
  const auto imu_ns = *rc::gen::inRange<std::int64_t>(1, 6) * kMs;
  const auto image_ns = *rc::gen::inRange<std::int64_t>(5, 200) * kMs;
  const auto jitter_ns = *rc::gen::inRange<std::int64_t>(0, 30) * kMs;
  const Sent run = simulate(rate_hz, imu_ns, image_ns, jitter_ns, 3'000 * kMs);
  RC_ASSERT(run.sent_ns.size() > 10U);
  RC_ASSERT(keeps_promises(run, rate_hz, 1e-4 * rate_hz));
  for (const std::int64_t delay : run.image_delay_ns) RC_ASSERT(static_cast<double>(delay) <= 1e9 / rate_hz + 0.1e6);
}

}  // namespace
}  // namespace epiline
