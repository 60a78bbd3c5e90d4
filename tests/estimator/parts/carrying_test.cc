// docs/derivations/health.md#reset
#include "estimator/parts/carrying.h"

#include <gtest/gtest.h>

#include <memory>

namespace epiline {
namespace {

HostStamp at(double seconds) { return HostStamp{} + Span::from_seconds(seconds); }

// A state is asked for an instant before its own where readings are ahead of the images, or where a solve finds that
// images are late by more than their interval.
TEST(Carrying, AnInstantBeforeTheStateIsReachedOnlyFromWhereThatStateBegan) {
  const auto common = std::make_unique<Common>(EstimatorConfig{});
  const Intervals intervals(*common);
  Carrying carrying(*common, intervals);
  int next = 0;
  const auto read_until = [&](double seconds) {
    for (; next <= seconds * 200; ++next) {
      ImuSample sample;
      sample.stamp = at(100 + next / 200.0);
      sample.specific_force_m_s2 = {0, 0, 9.81};
      common->history.push(sample);
    }
  };
  const auto solved = [&](double seconds, double x) {
    common->carried = {};
    common->carried.known = common->carried.trusted = true;
    common->carried.time = at(100 + seconds);
    common->carried.x.p.x() = x;
  };
  read_until(1);
  solved(0.5, 1);
  EXPECT_EQ(carrying.to(at(100.45)).time, at(100.5)) << "nothing is known of before";
  EXPECT_EQ(carrying.to(at(100.45)).x.p.x(), 1);
  read_until(2);
  carrying.keep_up();
  ASSERT_EQ(common->carried.time, at(102)) << "carried on by the readings";
  EXPECT_EQ(carrying.to(at(101)).time, at(101));
  read_until(3);
  solved(2.9, 2);
  EXPECT_EQ(carrying.to(at(102.85)).time, at(102.9)) << "it did not begin there";
  EXPECT_EQ(carrying.to(at(102.85)).x.p.x(), 2);
}

}  // namespace
}  // namespace epiline
