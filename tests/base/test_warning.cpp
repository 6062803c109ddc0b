#include <cctype>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "base/warning.h"

namespace angiospline {
namespace {

TEST(Warning, EveryCodeIsFoundByItsName) {
  EXPECT_GT(warning_kinds().size(), 30U);
  for (const WarningKind& kind : warning_kinds()) {
    EXPECT_EQ(name_of(kind.code), kind.name);
    EXPECT_EQ(warning_code(kind.name), kind.code);
  }
}

TEST(Warning, NamesAreDistinctWordsInLowerCaseJoinedByHyphens) {
  std::set<std::string> names;
  for (const WarningKind& kind : warning_kinds()) {
    const std::string name(kind.name);
    EXPECT_TRUE(names.insert(name).second) << name;
    EXPECT_FALSE(name.front() == '-' || name.back() == '-') << name;
    for (const char c : name) EXPECT_TRUE(std::islower(c) || c == '-') << name;
    EXPECT_EQ(kind.meaning.find('\n'), std::string::npos) << name;
    EXPECT_GT(kind.meaning.size(), kind.name.size()) << name;
  }
}

// Scripts compare with these; a name that changes breaks them.
TEST(Warning, NamesStayWhatTheyWere) {
  EXPECT_EQ(name_of(WarningCode::kUnspecified), "unspecified");
  EXPECT_EQ(name_of(WarningCode::kProbableLeak), "probable-leak");
  EXPECT_EQ(name_of(WarningCode::kVesselsOverlap), "vessels-overlap");
  EXPECT_EQ(name_of(WarningCode::kJunctionNotFair), "junction-not-fair");
  EXPECT_EQ(name_of(WarningCode::kNoWallInImage), "no-wall-in-image");
  EXPECT_EQ(name_of(WarningCode::kMeshCoarsened), "mesh-coarsened");
}

TEST(Warning, ANameThatIsNotKnownIsUnspecified) {
  EXPECT_EQ(warning_code("vessel-hums"), WarningCode::kUnspecified);
  EXPECT_EQ(warning_code(""), WarningCode::kUnspecified);
}

TEST(Warning, TextsAndNamesAreInTheOrderOfTheWarnings) {
  const std::vector<Warning> warnings{{WarningCode::kWallFolds, "b folds"},
                                      {WarningCode::kBadRadius, "a is thin"}};
  EXPECT_EQ(texts_of(warnings), (std::vector<std::string>{"b folds", "a is thin"}));
  EXPECT_EQ(code_names_of(warnings), (std::vector<std::string>{"wall-folds", "bad-radius"}));
}

}  // namespace
}  // namespace angiospline
