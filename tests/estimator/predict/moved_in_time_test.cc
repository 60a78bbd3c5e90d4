// A state taken to another instant by the readings between, against a path known in closed form.
#include "estimator/predict/moved_in_time.h"

#include <gtest/gtest.h>

#include <memory>

#include "tests/estimator/made_up_time.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

class MovedInTime : public testing::Test {
 protected:
  MovedInTime() {
    for (int i = 0; i < 200; ++i) {
      const double t = 0.005 * i;
      const Vec3 w = path_.w(t), a = path_.R(t).transpose() * (path_.a(t) - kGravity_W);
      history_->push({.stamp = at(t),
                      .angular_velocity_rad_s = {w.x(), w.y(), w.z()},
                      .specific_force_m_s2 = {a.x(), a.y(), a.z()}});
    }
  }
  NavState truth(double t) const {
    NavState x;
    x.p = path_.p(t);
    x.v = path_.v(t);
    x.R = path_.R(t);
    return x;
  }

  const SyntheticPath path_{1};
  const std::unique_ptr<ImuHistory> history_ = std::make_unique<ImuHistory>();
};

TEST_F(MovedInTime, IsOnThePathBeforeAndAfter) {
  for (const double dt : {-0.1, -0.047, -0.002, 0.0, 0.003, 0.05, 0.1}) {
    const NavState moved = moved_in_time(*history_, {}, truth(0.5), at(0.5), at(0.5 + dt)), x = truth(0.5 + dt);
    EXPECT_LT((moved.p - x.p).norm(), 1e-6) << dt;
    EXPECT_LT((moved.v - x.v).norm(), 1e-5) << dt;
    EXPECT_LT(so3_log(x.R.transpose() * moved.R).norm(), 1e-5) << dt;
  }
}

TEST_F(MovedInTime, ThereAndBackIsTheSame) {
  const NavState x = truth(0.5);
  for (const double dt : {-0.08, 0.0613}) {
    const NavState there = moved_in_time(*history_, {}, x, at(0.5), at(0.5 + dt));
    const NavState back = moved_in_time(*history_, {}, there, at(0.5 + dt), at(0.5));
    EXPECT_LT((back.p - x.p).norm() + (back.v - x.v).norm() + (back.R - x.R).norm(), 1e-12) << dt;
  }
}

}  // namespace
}  // namespace epiline::test
