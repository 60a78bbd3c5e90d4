#include "platform/error/contract.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

int third(const int (&values)[4], int i) {
  EPILINE_EXPECTS(i >= 0 && i < 4, "index within the array");
  return values[i];
}

TEST(ContractDeathTest, ABrokenContractNamesPlaceTextAndCondition) {
  const int values[4] = {1, 2, 3, 4};
  EXPECT_EQ(third(values, 2), 3);
  // a compiler cache may turn the path into one relative to the build folder
  EXPECT_DEATH(
      third(values, 4),
      "epiline: bug: (../)*tests/platform/error/contract_test.cc:[0-9]+: index within the array \\(i >= 0 && i < 4\\)");
}

TEST(Contract, TheConditionIsEvaluatedOnce) {
  int evaluated = 0;
  EPILINE_EXPECTS(++evaluated == 1, "first time");
  EXPECT_EQ(evaluated, 1);
}

}  // namespace
}  // namespace epiline
