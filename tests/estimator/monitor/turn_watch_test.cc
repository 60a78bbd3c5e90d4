// What camera and gyroscope say of each other, against a rig whose numbers are known: docs/derivations/turns.md.
#include "estimator/monitor/turn_watch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <tuple>

#include "estimator/geometry/so3.h"
#include "estimator/monitor/suspicion.h"
#include "tests/support/made_up_wave.h"

namespace epiline::test {
namespace {

constexpr double kNothingFades_s = 1e9;

TurnAgreement agreement_of(const MadeUpWave& made) {
  auto watch = std::make_unique<TurnWatch>(0, kNothingFades_s);
  made.play(*watch);
  return watch->agreement();
}

/// Names of those raised, for comparison.
std::vector<Suspect> raised(const Suspicions& suspicions) {
  std::vector<Suspect> list;
  for (std::size_t i = 0; i < suspicions.size(); ++i)
    if (suspicions[i].severity != Severity::kNone) list.push_back(static_cast<Suspect>(i));
  return list;
}

Suspicion one(const Suspicions& suspicions, Suspect suspect) { return suspicions[static_cast<std::size_t>(suspect)]; }

/// About the means nothing is left but noise, and the means hold the gyroscope's bias.
TEST(TurnWatch, ASteadyTurnAccusesNobody) {
  MadeUpWave made;
  made.steady = true;
  made.lasts_s = 40;
  made.alter = [](ImuSample& s) {  // shaken, as by rotors
    for (std::size_t k = 0; k < 3; ++k)
      s.angular_velocity_rad_s[k] +=
          0.05 * std::sin(static_cast<double>(31 + 7 * k) * 2 * M_PI * 1e-9 * static_cast<double>(s.stamp.ns));
  };
  const TurnAgreement seen = agreement_of(made);
  ASSERT_GT(seen.turns, 100);
  EXPECT_LT(seen.agreement, 0.35);
  EXPECT_EQ(raised(suspicions_of(seen, made.R_BC, made.offset_s, {}, 1)), std::vector<Suspect>());
}

TEST(TurnWatch, SaysHowSureItIsOfTheRotation) {
  MadeUpWave made;
  const TurnAgreement t = agreement_of(made);
  const Vec3 off = so3_log(made.R_BC.transpose() * t.R_BC);
  // chi^2 of three numbers is beyond 16 once in a thousand times; and not all of the error may be claimed
  EXPECT_LT(off.dot(t.R_BC_covariance.inverse() * off), 16);
  EXPECT_LT(std::sqrt(t.R_BC_covariance.trace()), 0.01);
  EXPECT_NEAR(t.rate_ratio, 1, 0.01);
}

TEST(TurnWatch, CorruptReadingsShuffledFeaturesAndImpossibleBearingsChangeLittle) {
  const double turns = agreement_of({}).turns;
  int n = 0;
  std::mt19937 random(2);
  MadeUpWave corrupt, shuffled, impossible;
  corrupt.alter = [&](ImuSample& s) {
    if (++n % 150 == 0) s.angular_velocity_rad_s[0] = 35;
  };
  shuffled.spoil = [&](TrackedFrame& frame) { std::shuffle(frame.features.begin(), frame.features.end(), random); };
  impossible.spoil = [&](TrackedFrame& frame) {  // of different tracks, so that each is seen well before and after
    const auto first_number = [&](int k) -> double& {
      return frame.features[static_cast<std::size_t>((n + k) % 80)].bearing[0];
    };
    first_number(0) = std::numeric_limits<double>::quiet_NaN();
    first_number(30) = 1e9;
    ++n;
  };
  for (const MadeUpWave* made : {&corrupt, &shuffled, &impossible}) {
    const TurnAgreement t = agreement_of(*made);
    EXPECT_EQ(t.turns, turns);
    EXPECT_GT(t.agreement, 0.99);
    EXPECT_LT(so3_log(made->R_BC.transpose() * t.R_BC).norm(), made == &shuffled ? 0.01 : 0.02);
  }
}

TEST(TurnWatch, ForgetsWhatIsOld) {
  const MadeUpWave made;
  auto watch = std::make_unique<TurnWatch>(0, 2.);
  made.play(*watch);
  EXPECT_NEAR(watch->agreement().turns, 2 / 0.05, 3) << "memory over the time between two images";
}

TEST(Suspicions, RightNumbersRaiseNone) {
  const MadeUpWave made;
  EXPECT_TRUE(raised(suspicions_of(agreement_of(made), made.R_BC, made.offset_s)).empty());
  EXPECT_TRUE(raised(suspicions_of(TurnAgreement{}, Mat3::Identity(), 0)).empty()) << "before anything turned";
}

TEST(Suspicions, EachWrongNumberIsNamed) {
  MadeUpWave made;
  made.offset_s = 0.005;
  const TurnAgreement t = agreement_of(made);
  const auto turned = [&](double angle) { return Mat3(made.R_BC * so3_exp(angle * Vec3(0.6, 0, 0.8))); };
  EXPECT_TRUE(raised(suspicions_of(t, turned(0.05), made.offset_s)).empty()) << "the estimator finds that out";
  for (const double angle : {0.17, 0.5, 1.5}) {
    const Suspicions s = suspicions_of(t, turned(angle), made.offset_s);
    EXPECT_EQ(raised(s), std::vector{Suspect::kRotation});
    EXPECT_NEAR(one(s, Suspect::kRotation).figure, angle, 0.02);
    EXPECT_EQ(one(s, Suspect::kRotation).severity, angle > 0.4 ? Severity::kGross : Severity::kSuspect);
  }
  const auto inverted = raised(suspicions_of(t, made.R_BC.transpose(), made.offset_s));
  EXPECT_EQ(inverted, std::vector{Suspect::kInverted});
  MadeUpWave early;
  early.offset_s = -0.06;
  const Suspicions late = suspicions_of(agreement_of(early), early.R_BC, 0);
  EXPECT_EQ(raised(late), std::vector{Suspect::kTimeOffset});
  EXPECT_NEAR(one(late, Suspect::kTimeOffset).figure, -0.06, 0.002);
}

TEST(Suspicions, WrongUnitsAndAxesAreNamed) {
  MadeUpWave degrees, swapped, flipped;
  degrees.alter = [](ImuSample& s) {
    for (double& w : s.angular_velocity_rad_s) w *= 57.29578;
  };
  swapped.alter = [](ImuSample& s) { std::swap(s.angular_velocity_rad_s[0], s.angular_velocity_rad_s[1]); };
  flipped.alter = [](ImuSample& s) { s.angular_velocity_rad_s[2] *= -1; };
  Suspicions s = suspicions_of(agreement_of(degrees), degrees.R_BC, degrees.offset_s);
  EXPECT_EQ(raised(s), std::vector{Suspect::kGyroscopeUnits});
  EXPECT_NEAR(one(s, Suspect::kGyroscopeUnits).figure, 57.3, 1);
  s = suspicions_of(agreement_of(swapped), swapped.R_BC, swapped.offset_s);
  EXPECT_EQ(raised(s), std::vector{Suspect::kMirrored});
  EXPECT_EQ(one(s, Suspect::kMirrored).axes, (TurnedAxes{2, 1, 3}));
  s = suspicions_of(agreement_of(flipped), flipped.R_BC, flipped.offset_s);
  EXPECT_EQ(raised(s), std::vector{Suspect::kMirrored});
  EXPECT_EQ(one(s, Suspect::kMirrored).axes, (TurnedAxes{1, 2, -3}));
}

TEST(Suspicions, ReadingsOfAnotherFlightAreUnrelated) {
  MadeUpWave made;
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  Vec3 w = Vec3::Zero();
  made.alter = [&](ImuSample& s) {
    w = 0.99 * w + 0.14 * Vec3(normal(random), normal(random), normal(random));
    Vec3::Map(s.angular_velocity_rad_s.data()) = w;
  };
  const Suspicions s = suspicions_of(agreement_of(made), made.R_BC, made.offset_s);
  EXPECT_EQ(raised(s), std::vector{Suspect::kUnrelated});
}

TEST(Suspicions, AScaleIsNamed) {
  MadeUpWave made;
  made.alter = [](ImuSample& s) {
    for (double& w : s.angular_velocity_rad_s) w *= 1.1;
  };
  const Suspicions s = suspicions_of(agreement_of(made), made.R_BC, made.offset_s);
  EXPECT_EQ(raised(s), std::vector{Suspect::kScale});
  EXPECT_NEAR(one(s, Suspect::kScale).figure, 1.1, 0.01);
  EXPECT_TRUE(raised(suspicions_of(agreement_of(made), made.R_BC, made.offset_s, {1 / 1.1, 1})).empty())
      << "a lens that is found shorter shows turns smaller";
  EXPECT_FALSE(raised(suspicions_of(agreement_of(made), made.R_BC, made.offset_s, {1, 1.1})).empty());
  EXPECT_TRUE(raised(suspicions_of(agreement_of(made), made.R_BC, made.offset_s, {}, 1 / 1.1)).empty())
      << "the scale found explains it";
  EXPECT_FALSE(raised(suspicions_of(agreement_of(made), made.R_BC, made.offset_s, {}, 1.1)).empty());
}

TEST(Suspicions, AFocalLengthThatIsAnotherIsARemark) {
  for (const double ratio : {0.95, 1.043, 1.2}) {
    Suspicions far;
    add_focal_length(ratio, 1e-3, far);
    EXPECT_EQ(one(far, Suspect::kFocalLength).severity, Severity::kSuspect) << ratio;
  }
  for (const auto& [ratio, sigma, said] : {std::tuple{1.02, 1e-3, true},
                                           {0.97, 1e-3, true},
                                           {1.005, 1e-4, false},
                                           {1.05, 0.02, false},
                                           {1.05, 0.0, false}}) {
    Suspicions s;
    add_focal_length(ratio, sigma, s);
    EXPECT_EQ(one(s, Suspect::kFocalLength).severity, said ? Severity::kNote : Severity::kNone)
        << ratio << " " << sigma;
  }
}

TEST(Suspicions, NamesWhereTheFlightEstimatesTheCameraToBe) {
  const struct {
    FoundPose found;
    Severity rotation, place;
  } cases[] = {{{0.05, 0.001, 0.02, 0.001}, Severity::kNone, Severity::kNone},
               {{0.2, 0.05, 0.2, 0.05}, Severity::kNone, Severity::kNone},  // not sure of it
               {{0.2, 0.01, 0.2, 0.01}, Severity::kNote, Severity::kNote},
               {{0.4, 0.01, 0.6, 0.01}, Severity::kGross, Severity::kGross},
               {{0.4, 0, 0.6, 0}, Severity::kNone, Severity::kNone}};  // not estimated
  for (const auto& c : cases) {
    Suspicions s;
    add_pose(c.found, s);
    EXPECT_EQ(one(s, Suspect::kRotation).severity, c.rotation) << c.found.rotation_rad;
    EXPECT_EQ(one(s, Suspect::kPlace).severity, c.place) << c.found.place_m;
  }
  Suspicions named;
  named[static_cast<std::size_t>(Suspect::kRotation)] = {Severity::kSuspect, 0.3, {}};
  add_pose({0.4, 0.01, 0, 0.01}, named);
  EXPECT_EQ(one(named, Suspect::kRotation).figure, 0.3) << "turns have named it before";
  Suspicions inverted;
  inverted[static_cast<std::size_t>(Suspect::kInverted)] = {Severity::kGross, 0.01, {}};
  add_pose({3, 0.01, 0, 0.01}, inverted);
  EXPECT_EQ(raised(inverted), std::vector{Suspect::kInverted});
}

TEST(Suspicions, AScaleOfTheImuThatIsAnotherIsARemark) {
  for (const auto& [ratio, sigma, severity] : {std::tuple{1 / 1.03, 1e-3, Severity::kNote},
                                               {1 / 1.1, 1e-3, Severity::kSuspect},
                                               {1.2, 1e-3, Severity::kSuspect},
                                               {0.988, 1e-3, Severity::kNone},
                                               {0.97, 0.01, Severity::kNone},
                                               {0.97, 0.0, Severity::kNone}}) {
    Suspicions s;
    add_imu_scale(Suspect::kAccelerometerScale, ratio, sigma, s);
    EXPECT_EQ(one(s, Suspect::kAccelerometerScale).severity, severity) << ratio << " " << sigma;
    EXPECT_EQ(one(s, Suspect::kGyroscopeScale).severity, Severity::kNone);
  }
}

TEST(UnitsWatch, KnowsReadingsInGAndInDegrees) {
  struct Case {
    double force, rate;
    bool force_wrong, rate_wrong;
  };
  for (const Case& c :
       {Case{1, 0.2, true, false}, {9.5, 3, false, false}, {13.5, 20, false, true}, {32, 0, true, false}}) {
    UnitsWatch watch;
    for (int i = 0; i < 1201; ++i) {
      Suspicions early;
      add_suspicions(watch, early);
      EXPECT_TRUE(i > 1000 || raised(early).empty()) << "less than five seconds";
      ImuSample reading;
      reading.stamp = {1'000'000'000 + 5'000'000LL * i};
      reading.specific_force_m_s2 = {0, 0.6 * c.force, 0.8 * c.force};
      reading.angular_velocity_rad_s = {0, 0, c.rate};
      watch.add(reading);
    }
    Suspicions s;
    add_suspicions(watch, s);
    EXPECT_EQ(one(s, Suspect::kAccelerometerUnits).severity == Severity::kGross, c.force_wrong) << c.force;
    EXPECT_EQ(one(s, Suspect::kGyroscopeUnits).severity == Severity::kGross, c.rate_wrong) << c.rate;
    EXPECT_NEAR(watch.force_m_s2(), c.force, 1e-9);
  }
}

}  // namespace
}  // namespace epiline::test
