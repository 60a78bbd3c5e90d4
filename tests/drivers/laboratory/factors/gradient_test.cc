// The right-hand side of the compared factors against the slope of their own cost, on every instruction set of this
// machine; and that they see neither the position nor the heading of the whole. Derivations:
// docs/derivations/epipolar.md, docs/derivations/reprojection.md.
#include "tests/estimator/factors/gradient.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "drivers/laboratory/factors/epipolar.h"
#include "drivers/laboratory/factors/reprojection.h"

namespace epiline::test {
namespace {

/// Reprojection with its depths converged, as the points of the track factor are.
class ConvergedReprojection final : public VisualFactorModel {
 public:
  explicit ConvergedReprojection(InstructionSet set) : factor_(set) {}
  void collect(const Window& w, const VisualSettings& s) noexcept override { factor_.collect(w, s); }
  void linearise(const Window& w, VisualSystem& out) noexcept override {
    for (int i = 0; i < 40; ++i) {
      factor_.linearise(w, out);
      factor_.step(w);  // no camera moves: the depths alone
    }
    factor_.linearise(w, out);
  }
  double cost(const Window& w) noexcept override { return factor_.cost(w); }
  void marginalise_oldest(const Window&, const VisualSettings&, VisualSystem&) noexcept override {}

 private:
  ReprojectionFactor factor_;
};

/// Differences so small that no residual crosses the corner of Huber's kernel, where the slope bends.
constexpr double kWithinACorner = 1e-4;

class ComparedGradient : public testing::TestWithParam<InstructionSet> {
 protected:
  void SetUp() override {
    if (!runs_here(GetParam())) GTEST_SKIP() << "not on this machine";
  }
  static void check(const std::string& name, std::shared_ptr<VisualFactorModel> factor) {
    SyntheticWindow s = furnished_window();
    const Subject subject = visual(name, *s.window, std::move(factor), kWithinACorner);
    check_gradient(subject, *s.window);
    s.window->calibration.time_offset = 0;  // as in the test of the estimator's factors
    check_gauge(subject, *s.window);
  }
};

TEST_P(ComparedGradient, OfEpipolarIsTheSlopeOfTheCostAndLeavesPositionAndYawOpen) {
  check("epipolar", std::make_shared<EpipolarFactor>(GetParam()));
}

TEST_P(ComparedGradient, OfReprojectionIsTheSlopeOfTheCostAndLeavesPositionAndYawOpen) {
  check("reprojection", std::make_shared<ConvergedReprojection>(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, ComparedGradient, testing::ValuesIn(kInstructionSets),
                         [](const auto& set) { return name_of(set.param); });

}  // namespace
}  // namespace epiline::test
