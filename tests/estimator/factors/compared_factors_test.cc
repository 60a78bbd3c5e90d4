// Estimator, solver and marginalisation with the compared factors.
#include <gtest/gtest.h>

#include "estimator/factors/epipolar.h"
#include "estimator/factors/reprojection.h"
#include "tests/estimator/any_factor.h"

namespace epiline::test {
namespace {

EstimatorConfig config_with(VisualFactor factor) {
  EstimatorConfig config;
  config.visual_factor = factor;
  return config;
}

TEST(EpipolarFactor, IsTheSameOnEveryInstructionSet) { expect_same_on_every_set<EpipolarFactor>(); }

class ComparedFactor : public testing::TestWithParam<VisualFactor> {
 protected:
  static std::unique_ptr<VisualFactorModel> make() {
    if (GetParam() == VisualFactor::kEpipolar) return std::make_unique<EpipolarFactor>(best_instruction_set());
    return std::make_unique<ReprojectionFactor>(best_instruction_set());
  }
};

TEST_P(ComparedFactor, KeepsThePriorPositive) { expect_prior_stays_positive(*make()); }

TEST_P(ComparedFactor, HasItsStepsTried) { EXPECT_FALSE(make()->may_step_untried()); }

TEST_P(ComparedFactor, NeverAsksForMoreMemoryAfterConstruction) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  expect_no_heap_calls(config_with(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(All, ComparedFactor, testing::Values(VisualFactor::kEpipolar, VisualFactor::kReprojection),
                         [](const auto& factor) { return to_string(factor.param); });

TEST(ReprojectionFactor, FliesWithFewerTracks) {
  expect_little_effort_suffices(config_with(VisualFactor::kReprojection), {true, 60, 0});
}

}  // namespace
}  // namespace epiline::test
