#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

TEST(CommandReproduce, GivesTablesAsJsonWithBothFigures) {
  const auto run = run_angiospline({"reproduce", "7.2", "--quick", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  ASSERT_EQ(json["tables"].size(), 1U);
  const auto& table = json["tables"][0];
  EXPECT_EQ(table["id"], "7.2");
  EXPECT_EQ(table["rows"].size(), 6U);
  EXPECT_EQ(table["rows"][0]["figures"][1]["thesis"], 18);
  EXPECT_TRUE(table["rows"][5]["figures"][0]["thesis"].is_null());
  EXPECT_TRUE(table["rows"][5]["figures"][0]["ours"].is_number());
}

TEST(CommandReproduce, SmoothsTheThesissBoundaries) {
  const auto run = run_angiospline({"reproduce", "smoothing", "--quick", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto table = nlohmann::json::parse(run.out)["tables"][0];
  EXPECT_EQ(table["rows"].size(), 9U);
  EXPECT_EQ(table["rows"][1]["figures"][0]["thesis"], 134);
  EXPECT_EQ(table["rows"][1]["figures"][0]["ours"], 90);
  const std::string held = table["notes"][2];
  EXPECT_NE(held.find("6 of 45 constraints no unknown can change"), std::string::npos) << held;
  for (const auto& trend : table["trends"]) EXPECT_TRUE(trend["holds"]) << trend.dump();
}

TEST(CommandReproduce, UnknownTableIsBadInput) {
  const auto run = run_angiospline({"reproduce", "9.9"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find("9.9"), std::string::npos);
}

}  // namespace
}  // namespace angiospline::test
