#include "estimator/monitor/contradiction.h"

#include <gtest/gtest.h>

#include "estimator/monitor/suspicion.h"

namespace epiline::test {
namespace {

constexpr double kStep_s = 0.1, kMoves_px = 10;

/// As a wrong number leaves them: the best quarter has half the error of the median.
TrackFit everywhere(double residual_px) { return {residual_px, 0.5 * residual_px, 100, 0, 0}; }
/// Of 100 tracks.
TrackFit with_behind(int behind) { return {0.1, 0.05, 100, 100 - behind, behind}; }

void see(ContradictionWatch& watch, const TrackFit& fit, double seconds, bool at_rest = false, double imu_chi2 = 0) {
  for (double t = 0; t < seconds; t += kStep_s) watch.add(fit, imu_chi2, kStep_s, at_rest, kMoves_px);
}
void see(ContradictionWatch& watch, double residual_px, double seconds, bool at_rest = false) {
  see(watch, everywhere(residual_px), seconds, at_rest);
}
void see_imu(ContradictionWatch& watch, double chi2, double seconds, bool at_rest = false) {
  see(watch, everywhere(0.1), seconds, at_rest, chi2);
}

Severity verdict(const ContradictionWatch& watch, Suspect of = Suspect::kMisfit) {
  Suspicions s;
  add_contradictions(watch, 0.1, s);
  return s[static_cast<std::size_t>(of)].severity;
}

TEST(Misfit, BelievesAContradictionSoonerThanItsEnd) {
  ContradictionWatch watch;
  see(watch, 5, 1);
  EXPECT_EQ(verdict(watch), Severity::kGross);
  see(watch, 0.1, 2);
  EXPECT_NE(verdict(watch), Severity::kNone);
  see(watch, 0.1, 20);
  EXPECT_EQ(verdict(watch), Severity::kNone);
}

TEST(Misfit, TracksThatContradictTheOthersAccuseNoNumber) {
  ContradictionWatch watch;
  see(watch, {6, 0.05, 100, 0, 0}, 100);
  EXPECT_EQ(verdict(watch), Severity::kNone);
  see(watch, {6, 2, 100, 0, 0}, 3);
  EXPECT_EQ(verdict(watch), Severity::kGross);
}

TEST(Misfit, RestRefutesNothing) {
  ContradictionWatch watch;
  see(watch, 5, 1);
  const double before = watch.misfit_px().figure();
  see(watch, 0.1, 100, true);
  EXPECT_EQ(watch.misfit_px().figure(), before);
  see(watch, 9, 1, true);
  EXPECT_GT(watch.misfit_px().figure(), before);
}

TEST(Misfit, ANewStartMayTryButIsNotTrusted) {
  ContradictionWatch watch;
  see(watch, 9, 10);
  watch.restart();
  EXPECT_EQ(verdict(watch), Severity::kSuspect);
}

double seconds_until_trusted(ContradictionWatch& watch, double parallax_px = kMoves_px) {
  double t = 0;
  for (; verdict(watch) != Severity::kNone && t < 1000; t += kStep_s)
    watch.add(everywhere(0.1), 0, kStep_s, false, parallax_px);
  return t;
}

TEST(Misfit, EachFlightThatAContradictionEndedMakesItsEndTakeLongerUpToABound) {
  ContradictionWatch watch;
  double before = 0;
  for (int flight = 0; flight < 10; ++flight) {
    see(watch, 9, 3);
    watch.restart();
    watch.restart();  // a start that was refused: it ended no flight
    const double now = seconds_until_trusted(watch);
    if (flight == 1) {
      EXPECT_NEAR(now, 2 * before, 4 * kStep_s);
    }
    EXPECT_GE(now, before) << flight;
    EXPECT_LE(now, 30) << flight;
    before = now;
  }
  // and a good flight ends that
  see(watch, 0.1, 200);
  see(watch, 9, 3);
  watch.restart();
  EXPECT_LT(seconds_until_trusted(watch), 0.7 * before);
}

TEST(Misfit, ANudgeRefutesLittle) {
  ContradictionWatch flown, nudged;
  for (ContradictionWatch* watch : {&flown, &nudged}) see(*watch, 1.2, 3);
  EXPECT_NEAR(seconds_until_trusted(nudged, 1), 10 * seconds_until_trusted(flown), 1);
}

TEST(Misfit, ANewStartAfterAGoodFlightIsTrusted) {
  ContradictionWatch watch;
  see(watch, 0.2, 10);
  watch.restart();
  EXPECT_EQ(verdict(watch), Severity::kNone);
}

TEST(Misfit, NoNumberEndsAFlightThatFittedBefore) {
  ContradictionWatch watch;
  see(watch, 0.2, 4);
  see(watch, 9, 5);
  EXPECT_EQ(verdict(watch), Severity::kGross) << "this flight is no good";
  watch.restart();
  EXPECT_EQ(verdict(watch), Severity::kNone);
  see(watch, 9, 5);
  watch.restart();
  EXPECT_EQ(verdict(watch), Severity::kSuspect) << "that one had not fitted";
}

TEST(Misfit, ANumberThatHasFittedIsAccusedOnceItIsContradictedForLonger) {
  ContradictionWatch watch;
  EXPECT_TRUE(watch.may_accuse());
  see(watch, 0.2, 10);
  EXPECT_FALSE(watch.may_accuse());
  see(watch, 9, 5);
  EXPECT_FALSE(watch.may_accuse()) << "a lorry passes";
  see(watch, 9, 5);
  EXPECT_TRUE(watch.may_accuse());
  watch.restart();
  EXPECT_TRUE(watch.may_accuse()) << "the next flight remembers it";
}

TEST(Misfit, ARestProvesNoNumber) {
  ContradictionWatch watch;
  see(watch, 0.2, 60, true);
  see(watch, 9, 5);
  watch.restart();
  EXPECT_EQ(verdict(watch), Severity::kSuspect);
}

TEST(Misfit, OneWildResidualCannotHoldForLong) {
  ContradictionWatch watch;
  watch.add(everywhere(1e6), 0, 0.5, false, kMoves_px);
  EXPECT_LE(watch.misfit_px().figure(), 5);
  see(watch, 0.1, 20);
  EXPECT_EQ(verdict(watch), Severity::kNone);
}

TEST(Misfit, NoisyTracksContradictNobody) {
  ContradictionWatch watch;
  see(watch, 3, 3);
  Suspicions s;
  add_contradictions(watch, 2, s);
  EXPECT_EQ(s[static_cast<std::size_t>(Suspect::kMisfit)].severity, Severity::kNone);
}

TEST(ImuMisfit, IsSuspectAndNeverGross) {
  ContradictionWatch watch;
  see_imu(watch, 0.7, 100);
  EXPECT_EQ(verdict(watch, Suspect::kImuMisfit), Severity::kNone) << "what MH_01 has";
  see_imu(watch, 1.5, 2);
  EXPECT_EQ(verdict(watch, Suspect::kImuMisfit), Severity::kSuspect);
  see_imu(watch, 1e9, 100);
  EXPECT_EQ(verdict(watch, Suspect::kImuMisfit), Severity::kSuspect);
  EXPECT_EQ(watch.worst(), Severity::kSuspect);
  EXPECT_EQ(verdict(watch), Severity::kNone) << "the tracks fit";
}

/// Landing is a blow that the readings are too rare for.
TEST(ImuMisfit, ABlowIsNoWrongNumberAndCountsNoLongerAtRest) {
  ContradictionWatch watch;
  see_imu(watch, 0.2, 10);
  see_imu(watch, 1e4, 0.1);
  const double before = watch.imu_chi2().figure();
  see_imu(watch, 1e4, 60, true);
  EXPECT_EQ(watch.imu_chi2().figure(), before);
  EXPECT_EQ(verdict(watch, Suspect::kImuMisfit), Severity::kNone);
  see_imu(watch, 0, 60, true);
  EXPECT_EQ(watch.imu_chi2().figure(), before) << "rest refutes nothing";
}

TEST(Behind, MostTracksBehindTheCameraAreGrossWithinASecond) {
  ContradictionWatch watch;
  see(watch, with_behind(15), 100);
  EXPECT_EQ(verdict(watch, Suspect::kBehind), Severity::kNone) << "the most that a window of a right flight had";
  see(watch, with_behind(80), 1);
  EXPECT_EQ(verdict(watch, Suspect::kBehind), Severity::kGross);
  EXPECT_EQ(watch.worst(), Severity::kGross);
}

TEST(Behind, AFewTracksWithAClearDepthSayNothing) {
  ContradictionWatch watch;
  see(watch, {0.1, 0.05, 19, 0, 19}, 100);
  EXPECT_EQ(watch.behind().figure(), 0);
  see(watch, {0.1, 0.05, 120, 0, 39}, 100);
  EXPECT_EQ(watch.behind().figure(), 0) << "a third of the tracks at least";
  see(watch, {0.1, 0.05, 60, 0, 20}, 1);
  EXPECT_GT(watch.behind().figure(), 0.9);
}

TEST(Behind, DepthsAtRestAreNoise) {
  ContradictionWatch watch;
  see(watch, {0.1, 0.05, 60, 20, 20}, 100, true);
  EXPECT_EQ(watch.behind().figure(), 0);
}

TEST(Behind, ATurnOnTheSpotAfterwardsDoesNotMakeItTrusted) {
  ContradictionWatch watch;
  see(watch, with_behind(80), 5);
  watch.restart();
  EXPECT_EQ(verdict(watch, Suspect::kBehind), Severity::kSuspect) << "gross would refuse the start";
  see(watch, with_behind(0), 10);
  EXPECT_EQ(verdict(watch, Suspect::kBehind), Severity::kSuspect);
  see(watch, with_behind(0), 60);
  EXPECT_EQ(verdict(watch, Suspect::kBehind), Severity::kNone);
}

}  // namespace
}  // namespace epiline::test
