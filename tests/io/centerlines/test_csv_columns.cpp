#include <array>

#include <gtest/gtest.h>

#include "io/centerlines/csv_columns.h"

namespace angiospline {
namespace {

Result<CsvColumns> named(std::vector<std::string_view> header) {
  return columns_by_name(header, "f", 1);
}

TEST(CsvColumns, AreKnownByTheirNamesHoweverTheseAreWritten) {
  const auto columns = named({"Point_ID", "Pos_X [um]", "POS-Y", "pos.z", "note", "Diameter"});
  ASSERT_TRUE(columns);
  EXPECT_EQ(columns->count, 6u);
  EXPECT_EQ(columns->xyz, (std::array{1, 2, 3}));
  EXPECT_EQ(columns->id, 0);
  EXPECT_EQ(columns->radius, 5);
  EXPECT_TRUE(columns->diameters);
  EXPECT_EQ(columns->unit, "um");
  EXPECT_EQ(columns->parent, kNoColumn);
  EXPECT_EQ(columns->unnamed, kNoColumn);
}

TEST(CsvColumns, ARadiusBeatsADiameterOnEitherSideOfIt) {
  for (const bool first : {true, false}) {
    const auto columns = named({"x", "y", "z", first ? "r" : "d", first ? "d" : "r"});
    ASSERT_TRUE(columns);
    EXPECT_EQ(columns->radius, first ? 3 : 4);
    EXPECT_FALSE(columns->diameters);
  }
}

TEST(CsvColumns, TwoOfOneMeaningCannotBeTold) {
  const auto columns = named({"x", "y", "z", "r", "branch", "vessel"});
  ASSERT_FALSE(columns);
  EXPECT_EQ(columns.error().what, "two columns have the same meaning");
  EXPECT_EQ(columns.error().value, "'vessel'");
  EXPECT_TRUE(named({"x", "y", "z", "d", "diam"})) << "the first diameter is taken";
}

TEST(CsvColumns, NeedAPlaceAndARadius) {
  const std::vector<std::vector<std::string_view>> headers = {
      {"x", "y", "radius"}, {"x", "y", "z"}, {}};
  for (const std::vector<std::string_view>& header : headers) {
    ASSERT_FALSE(named(header));
    EXPECT_EQ(named(header).error().what, "the header line names no x, y, z and radius");
  }
}

TEST(CsvColumns, WithoutAHeaderAreFourOrFiveInOrder) {
  EXPECT_EQ(columns_by_order(4, "f", 1)->unnamed, kNoColumn);
  EXPECT_EQ(columns_by_order(5, "f", 1)->unnamed, 4);
  EXPECT_EQ(columns_by_order(5, "f", 1)->radius, 3);
  EXPECT_FALSE(columns_by_order(3, "f", 1));
  EXPECT_FALSE(columns_by_order(6, "f", 1));
}

}  // namespace
}  // namespace angiospline
