#include <gtest/gtest.h>

#include "base/result.h"

namespace angiospline {
namespace {

TEST(Error, MessageNamesPlaceValueAndRuleOnOneLine) {
  const Error error{ErrorKind::kBadInput, "radius is negative", "tree.swc:12", "-0.5",
                    "radii must\nbe positive"};
  EXPECT_EQ(error.message(), "tree.swc:12: radius is negative: -0.5 (radii must be positive)");
}

TEST(Error, MessageLeavesOutEmptyParts) {
  EXPECT_EQ((Error{ErrorKind::kFailed, "no vessel", {}, {}, {}}).message(), "no vessel");
}

}  // namespace
}  // namespace angiospline
