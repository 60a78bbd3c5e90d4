#include "drivers/flights/motion/profile_matrix.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <vector>

#include "drivers/flights/motion/random.h"

namespace epiline {
namespace {

/// A random matrix of that profile, diagonally dominant, and the same as a dense one.
struct Both {
  ProfileMatrix profile;
  Eigen::MatrixXd dense;

  explicit Both(const std::vector<int>& first) : profile(first) {
    const int n = static_cast<int>(first.size());
    dense = Eigen::MatrixXd::Zero(n, n);
    Random random(7, 0);
    for (int i = 0; i < n; ++i)
      for (int j = first[static_cast<std::size_t>(i)]; j <= i; ++j) {
        const double value = i == j ? 20 : random.normal();
        profile.at(i, j) = value;
        dense(i, j) = dense(j, i) = value;
      }
  }
};

TEST(ProfileMatrixTest, SolvesAsADenseCholeskyDoes) {
  std::vector<int> band;
  for (int i = 0; i < 60; ++i) band.push_back(i % 11 == 10 ? i / 2 : std::max(0, i - 4));  // with some long rows
  std::vector<int> with_border = band;
  with_border.insert(with_border.end(), 3, 0);
  for (const std::vector<int>& first : {with_border, band, std::vector<int>(50, 0)}) {
    Both both(first);
    const auto n = static_cast<Eigen::Index>(first.size());
    const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(n, -1, 3);
    std::vector<double> x(b.data(), b.data() + n);
    ASSERT_TRUE(both.profile.factorise());
    both.profile.solve(x);
    const Eigen::VectorXd expected = both.dense.ldlt().solve(b);
    EXPECT_LT((Eigen::Map<Eigen::VectorXd>(x.data(), n) - expected).norm(), 1e-12 * expected.norm());
  }
}

TEST(ProfileMatrixTest, RefusesWhatIsNotPositiveDefinite) {
  for (const double value : {-1.0, 0.0, std::numeric_limits<double>::quiet_NaN()}) {
    for (const int where : {0, 2, 4, 5}) {
      Both both({0, 0, 1, 2, 0, 0});
      both.profile.at(where, where) = value;
      EXPECT_FALSE(both.profile.factorise()) << value << " at " << where;
    }
  }
}

}  // namespace
}  // namespace epiline
