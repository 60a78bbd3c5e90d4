#include "drivers/program/check/value_check.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>
#include <vector>

namespace epiline {

namespace {

/// Samples as they are given, then the end.
template <class Source, class Sample>
class Listed final : public Source {
 public:
  explicit Listed(std::vector<Sample> samples) : samples_(std::move(samples)) {}
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(Sample& sample, Span /*timeout*/) noexcept override {
    if (next_ == samples_.size()) return ended_ = true, ReadOutcome::kEnd;
    sample = samples_[next_++];
    return ReadOutcome::kSample;
  }
  ValueResults heard() {
    ValueCheck<Source, Sample> check(*this);
    while (!ended_) std::this_thread::yield();
    return check.so_far();
  }

 private:
  std::vector<Sample> samples_;
  std::size_t next_ = 0;
  std::atomic<bool> ended_{false};
};

Finding finding_of(const std::vector<double>& speeds) {
  std::vector<WheelSample> samples;
  for (const double speed : speeds) samples.push_back({{std::ssize(samples) * 20'000'000}, speed, 0});
  return findings_of_wheels(Listed<WheelSource, WheelSample>(std::move(samples)).heard()).at(0);
}

Findings findings_of(std::vector<HeightSample> samples, const std::array<bool, kHeightKinds>& wanted = {true, true}) {
  return findings_of_heights(Listed<HeightSource, HeightSample>(std::move(samples)).heard(), wanted);
}

/// Twenty heights, from `from_m` on, 0.1 m apart.
std::vector<HeightSample> heights(HeightKind kind, double from_m, std::int64_t apart_ns) {
  std::vector<HeightSample> all;
  for (int i = 0; i < 20; ++i) all.push_back({{i * apart_ns}, kind, from_m + 0.1 * i});
  return all;
}

}  // namespace

TEST(WheelFindings, SayRateAndRange) {
  EXPECT_EQ(finding_of({0.5, -0.25, 1}).text, "50.0 speeds per second, jitter 0.0 ms, from -0.25 to 1.00 m/s");
  EXPECT_EQ(finding_of({0.5, 1}).grade, Grade::kOk);
  EXPECT_EQ(finding_of({0, 0, 655.35}).grade, Grade::kWarning) << "an unsigned reading of a small step back";
  EXPECT_EQ(finding_of({}).grade, Grade::kError);
}

TEST(HeightFindings, SayHowOftenEachSensorSpeaksAndWhatItSays) {
  auto both = heights(HeightKind::kBarometer, -3, 50'000'000);
  const auto range = heights(HeightKind::kRangeFinder, 1.5, 100'000'000);
  both.insert(both.end(), range.begin(), range.end());
  const Findings all = findings_of(both);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].text, "barometer: 20.0 heights per second, jitter 0.0 ms, from -3.00 to -1.10 m");
  EXPECT_EQ(all[1].text, "range finder: 10.0 heights per second, jitter 0.0 ms, from 1.50 to 3.40 m");
  for (const Finding& f : all) {
    EXPECT_EQ(f.grade, Grade::kOk);
    EXPECT_EQ(f.device, "height");
  }
}

TEST(HeightFindings, WarnOfASensorThatIsSilentOrTooSlow) {
  const Findings all = findings_of(heights(HeightKind::kBarometer, 0, 500'000'000));
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].grade, Grade::kWarning);
  EXPECT_EQ(all[0].remedy, "at least 4 a second: raise the flight controller's stream rate");
  EXPECT_EQ(all[1].text, "no height of a range finder");
  EXPECT_EQ(all[1].remedy, "let its source send it (docs/height.md), or set height.range = false");
}

TEST(HeightFindings, SayNothingOfASensorThatTheConfigurationDoesNotUse) {
  EXPECT_TRUE(findings_of(heights(HeightKind::kBarometer, 0, 50'000'000), {false, false}).empty());
}

}  // namespace epiline
