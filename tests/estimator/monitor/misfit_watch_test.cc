#include "estimator/monitor/misfit_watch.h"

#include <gtest/gtest.h>

#include "estimator/monitor/suspicion.h"

namespace epiline {
namespace {

constexpr double kStep_s = 0.1;

/// As a wrong number leaves them: the best quarter has half the error of the median.
ResidualNoise everywhere(double residual_px) { return {residual_px, 0.5 * residual_px}; }

void see(MisfitWatch& watch, const ResidualNoise& residual, double seconds, bool at_rest = false) {
  for (double t = 0; t < seconds; t += kStep_s) watch.add(residual, kStep_s, at_rest);
}
void see(MisfitWatch& watch, double residual_px, double seconds, bool at_rest = false) {
  see(watch, everywhere(residual_px), seconds, at_rest);
}

Severity verdict(const MisfitWatch& watch) {
  Suspicions s;
  add_misfit(watch.px(), 0.1, s);
  return s[static_cast<std::size_t>(Suspect::kMisfit)].severity;
}

TEST(MisfitWatch, BelievesAContradictionSoonerThanItsEnd) {
  MisfitWatch watch;
  see(watch, 5, 1);
  EXPECT_EQ(verdict(watch), Severity::kGross);
  see(watch, 0.1, 2);
  EXPECT_NE(verdict(watch), Severity::kNone);
  see(watch, 0.1, 20);
  EXPECT_EQ(verdict(watch), Severity::kNone);
}

TEST(MisfitWatch, TracksThatContradictTheOthersAccuseNoNumber) {
  MisfitWatch watch;
  see(watch, {6, 0.05}, 100);
  EXPECT_EQ(verdict(watch), Severity::kNone);
  see(watch, {6, 2}, 3);
  EXPECT_EQ(verdict(watch), Severity::kGross);
}

TEST(MisfitWatch, RestRefutesNothing) {
  MisfitWatch watch;
  see(watch, 5, 1);
  const double before = watch.px();
  see(watch, 0.1, 100, true);
  EXPECT_EQ(watch.px(), before);
  see(watch, 9, 1, true);
  EXPECT_GT(watch.px(), before);
}

TEST(MisfitWatch, ANewStartMayTryButIsNotTrusted) {
  MisfitWatch watch;
  see(watch, 9, 10);
  watch.restart();
  EXPECT_EQ(verdict(watch), Severity::kSuspect);
}

double seconds_until_trusted(MisfitWatch& watch) {
  double t = 0;
  for (; verdict(watch) != Severity::kNone && t < 1000; t += kStep_s) watch.add(everywhere(0.1), kStep_s, false);
  return t;
}

TEST(MisfitWatch, EachFlightThatAContradictionEndedMakesItsEndTakeTwiceAsLong) {
  MisfitWatch watch;
  double before = 0;
  for (int flight = 0; flight < 4; ++flight) {
    see(watch, 9, 3);
    watch.restart();
    watch.restart();  // a start that was refused: it ended no flight
    const double now = seconds_until_trusted(watch);
    if (flight > 0) {
      EXPECT_NEAR(now, 2 * before, 4 * kStep_s) << flight;
    }
    before = now;
  }
}

TEST(MisfitWatch, ANewStartAfterAGoodFlightIsTrusted) {
  MisfitWatch watch;
  see(watch, 0.2, 10);
  const double before = watch.px();
  watch.restart();
  EXPECT_EQ(watch.px(), before);
  EXPECT_EQ(verdict(watch), Severity::kNone);
}

TEST(MisfitWatch, OneWildResidualCannotHoldForLong) {
  MisfitWatch watch;
  watch.add(everywhere(1e6), 0.5, false);
  EXPECT_LE(watch.px(), 5);
  see(watch, 0.1, 20);
  EXPECT_EQ(verdict(watch), Severity::kNone);
}

}  // namespace
}  // namespace epiline
