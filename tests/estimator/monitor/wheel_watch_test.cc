// docs/derivations/wheel.md#words
#include "estimator/monitor/wheel_watch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

namespace epiline::test {
namespace {

/// A vehicle's speed: it stands, drives, slows down, drives.
double speed(double t) { return t < 2 ? 0 : std::min(1.0, 0.5 * (t - 2)) + 0.5 * std::sin(0.6 * (t - 2)); }

struct Case {
  std::string name;
  std::function<double(double t)> read;
  Suspect word;
  double figure;  ///< 0: none
};

TEST(WheelWatch, NamesWhatIsWrong) {
  const Case cases[] = {
      {"right", speed, Suspect::kWheelScale, 0},
      {"2 % too much, seen to 2 %", [](double t) { return 1.02 * speed(t); }, Suspect::kWheelScale, 0},
      {"noise", [](double t) { return speed(t) + 0.02 * std::sin(1e4 * t); }, Suspect::kWheelSlip, 0},
      {"wrong sign", [](double t) { return -speed(t); }, Suspect::kWheelScale, -1},
      {"km/h", [](double t) { return 3.6 * speed(t); }, Suspect::kWheelScale, 1 / 3.6},
      {"a fifth too much", [](double t) { return 1.25 * speed(t); }, Suspect::kWheelScale, 0.8},
      {"late", [](double t) { return speed(t - 0.3); }, Suspect::kWheelDelay, 0.3},
      {"slips now and then", [](double t) { return std::fmod(t, 5) < 1.5 ? 1.6 * speed(t) : speed(t); },
       Suspect::kWheelSlip, 0.22},
      {"stuck", [](double t) { return speed(std::min(t, 8.0)); }, Suspect::kWheelStuck, speed(8)},
      {"never turns", [](double) { return 0; }, Suspect::kWheelStuck, 1e-9},
  };
  for (const Case& c : cases) {
    WheelWatch watch(0.03);
    for (double t = 0; t < 30; t += 0.1) {
      const double u = speed(t), sigma = 0.02 * u + 0.01;
      watch.add({.dt_s = 0.1,
                 .read_m_s = c.read(t),
                 .true_m_s = u,
                 .gained_m_s2 = (speed(t + 0.05) - speed(t - 0.05)) / 0.1,
                 .variance_true = sigma * sigma,
                 .variance_read = 5e-4});
    }
    Suspicions said;
    add_suspicions(watch, said);
    for (std::size_t i = 0; i < said.size(); ++i) {
      const bool named = c.figure != 0 && i == static_cast<std::size_t>(c.word);
      EXPECT_EQ(said[i].severity, named ? Severity::kNote : Severity::kNone) << c.name << ": " << i;
      if (named) {
        EXPECT_NEAR(said[i].figure, c.figure, 0.15 * std::abs(c.figure) + 1e-3) << c.name;
      }
    }
    EXPECT_EQ(watch.is_stuck(), c.word == Suspect::kWheelStuck) << c.name;
  }
}

}  // namespace
}  // namespace epiline::test
