// Estimator, solver and marginalisation with the compared factors.
#include "drivers/laboratory/factors/visual_factors.h"

#include <gtest/gtest.h>

#include "drivers/laboratory/factors/epipolar.h"
#include "drivers/laboratory/factors/reprojection.h"
#include "tests/estimator/any_factor.h"

namespace epiline::test {
namespace {

EstimatorConfig config_with(const std::string& factor) {
  EstimatorConfig config;
  choose_visual_factor(factor, config);
  return config;
}

TEST(ComparedFactors, AreMadeByTheirNames) {
  EXPECT_EQ(config_with("track").visual_factor.make, nullptr);
  for (const std::string name : kVisualFactorNames) EXPECT_EQ(config_with(name).visual_factor.name, name);
  const auto made = [](const char* name) { return config_with(name).visual_factor.make(best_instruction_set()); };
  EXPECT_NE(dynamic_cast<EpipolarFactor*>(made("epipolar").get()), nullptr);
  EXPECT_NE(dynamic_cast<ReprojectionFactor*>(made("reprojection").get()), nullptr);
}

TEST(EpipolarFactor, IsTheSameOnEveryInstructionSet) { expect_same_on_every_set<EpipolarFactor>(); }

class ComparedFactor : public testing::TestWithParam<const char*> {
 protected:
  EstimatorConfig config_ = config_with(GetParam());
};

TEST_P(ComparedFactor, KeepsThePriorPositive) {
  expect_prior_stays_positive(*config_.visual_factor.make(best_instruction_set()));
}

TEST_P(ComparedFactor, HasItsStepsTried) {
  EXPECT_FALSE(config_.visual_factor.make(best_instruction_set())->may_step_untried());
}

TEST_P(ComparedFactor, NeverAsksForMoreMemoryAfterConstruction) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  expect_no_heap_calls(config_);
}

INSTANTIATE_TEST_SUITE_P(All, ComparedFactor, testing::Values("epipolar", "reprojection"),
                         [](const auto& factor) { return std::string(factor.param); });

TEST(ReprojectionFactor, FliesWithFewerTracks) {
  expect_little_effort_suffices(config_with("reprojection"), {true, 60, 0});
}

}  // namespace
}  // namespace epiline::test
