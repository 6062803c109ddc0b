#include <gtest/gtest.h>

#include "base/median.h"

namespace angiospline {
namespace {

TEST(Median, IsTheUpperMiddleValueInAnyOrder) {
  EXPECT_EQ(median({3, 1, 2}), 2);
  EXPECT_EQ(median({4, 1, 3, 2}), 3);
  EXPECT_EQ(median({7}), 7);
  EXPECT_EQ(median({}), 0);
}

}  // namespace
}  // namespace angiospline
