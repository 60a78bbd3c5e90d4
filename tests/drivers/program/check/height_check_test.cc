#include "drivers/program/check/height_check.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

namespace epiline {
namespace {

constexpr std::array<bool, kHeightKinds> kBoth{true, true};

/// Heights as they are given, then the end.
class ListedHeights final : public HeightSource {
 public:
  explicit ListedHeights(std::vector<HeightSample> heights) : heights_(std::move(heights)) {}
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(HeightSample& sample, Span /*timeout*/) noexcept override {
    if (next_ == heights_.size()) return ended_ = true, ReadOutcome::kEnd;
    sample = heights_[next_++];
    return ReadOutcome::kSample;
  }
  void wait() const {
    while (!ended_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

 private:
  std::vector<HeightSample> heights_;
  std::size_t next_ = 0;
  std::atomic<bool> ended_{false};
};

Findings found_in(std::vector<HeightSample> heights, const std::array<bool, kHeightKinds>& wanted) {
  ListedHeights source(std::move(heights));
  HeightCheck check(source);
  source.wait();
  return findings_of(check.so_far(), wanted);
}

/// Twenty heights, from `from_m` on, 0.1 m apart.
std::vector<HeightSample> heights(HeightKind kind, double from_m, std::int64_t apart_ns) {
  std::vector<HeightSample> all;
  for (int i = 0; i < 20; ++i) all.push_back({{i * apart_ns}, kind, from_m + 0.1 * i});
  return all;
}

TEST(HeightFindings, SayHowOftenEachSensorSpeaksAndWhatItSays) {
  auto both = heights(HeightKind::kBarometer, -3, 50'000'000);
  const auto range = heights(HeightKind::kRangeFinder, 1.5, 100'000'000);
  both.insert(both.end(), range.begin(), range.end());
  const Findings all = found_in(both, kBoth);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].text, "barometer: 20.0 heights per second, jitter 0.0 ms, from -3.00 to -1.10 m");
  EXPECT_EQ(all[1].text, "range finder: 10.0 heights per second, jitter 0.0 ms, from 1.50 to 3.40 m");
  for (const Finding& f : all) {
    EXPECT_EQ(f.grade, Grade::kOk);
    EXPECT_EQ(f.device, "height");
  }
}

TEST(HeightFindings, WarnOfASensorThatIsSilentOrTooSlow) {
  const Findings all = found_in(heights(HeightKind::kBarometer, 0, 500'000'000), kBoth);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].grade, Grade::kWarning);
  EXPECT_EQ(all[0].remedy, "at least 4 a second: raise the flight controller's stream rate");
  EXPECT_EQ(all[1].text, "no height of a range finder");
  EXPECT_EQ(all[1].remedy, "let its source send it (docs/height.md), or set height.range = false");
}

TEST(HeightFindings, SayNothingOfASensorThatTheConfigurationDoesNotUse) {
  EXPECT_TRUE(found_in(heights(HeightKind::kBarometer, 0, 50'000'000), {false, false}).empty());
}

}  // namespace
}  // namespace epiline
