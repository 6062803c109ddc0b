// A caller's bug ends the program, in release builds too, with the place and the condition.
#include <gtest/gtest.h>

#include "base/contract.h"

namespace angiospline {
namespace {

TEST(ContractDeathTest, ABrokenConditionEndsTheProgramAndSaysWhereAndWhich) {
  const int sectors = 2;
  EXPECT_DEATH(EXPECTS(sectors >= 3), "test_contract.cpp.*sectors >= 3");
}

TEST(Contract, AConditionThatHoldsIsEvaluatedOnceAndNothingElseHappens) {
  int evaluated = 0;
  EXPECTS(++evaluated == 1);
  EXPECT_EQ(evaluated, 1);
}

}  // namespace
}  // namespace angiospline
