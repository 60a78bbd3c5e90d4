// Derivation: docs/derivations/rolling_shutter.md.
#include "estimator/geometry/row_turn.h"

#include <gtest/gtest.h>

#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

TEST(RowTurn, FollowsAnExactPathWithinAnImage) {
  const SyntheticPath path{1};
  const Mat3 R_BC = synthetic_calibration().R_BC;
  for (const double half_s : {0.0025, 0.01, 0.0165})
    for (double t = 0; t < 5; t += 0.37) {
      const RowTurn rows = row_turn(path.R(t - half_s).transpose() * path.R(t),
                                    path.R(t).transpose() * path.R(t + half_s), half_s, R_BC);
      for (double row_s = -half_s; row_s <= half_s; row_s += half_s / 7) {
        const Mat3 exact = R_BC.transpose() * path.R(t).transpose() * path.R(t + row_s) * R_BC;
        // third order: no jerk of the path is above 1 rad/s^3
        EXPECT_LT(so3_log(exact.transpose() * rows.at(row_s)).norm(), 0.2 * half_s * half_s * half_s);
      }
    }
}

TEST(RowTurn, AtTheStampNothingTurns) {
  const RowTurn rows = row_turn(so3_exp({0.01, 0.02, 0}), so3_exp({0.02, 0.01, 0.01}), 0.01, Mat3::Identity());
  EXPECT_EQ(rows.at(0), Mat3::Identity());
  EXPECT_LT((rows.at(0.01) - so3_exp({0.02, 0.01, 0.01})).norm(), 1e-12);
  EXPECT_LT((rows.at(-0.01).transpose() - so3_exp({0.01, 0.02, 0})).norm(), 1e-12);
}

}  // namespace
}  // namespace epiline::test
