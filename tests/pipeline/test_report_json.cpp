// The figures that scripts rely on.
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "pipeline/report_json.h"

namespace angiospline {
namespace {

using Json = nlohmann::ordered_json;

std::vector<std::string> keys(const Json& json) {
  std::vector<std::string> names;
  for (const auto& item : json.items()) names.push_back(item.key());
  return names;
}

TEST(ReportJson, ABatchHasARowForEachTreeAndNullsWhereThereIsNoModel) {
  BatchReport batch;
  batch.trees.resize(2);
  batch.trees[0].name = "a";
  batch.trees[0].state = TreeState::kDone;
  batch.trees[0].exit_code = 0;
  batch.trees[0].seconds = 0.1;
  batch.trees[0].figures.emplace();
  batch.trees[0].figures->branches = 3;
  batch.trees[0].figures->volume_mm3 = 1.0 / 3.0;
  batch.trees[0].figures->max_normal_angle_deg = std::numeric_limits<double>::quiet_NaN();
  batch.trees[1].name = "b \"quoted\"";
  batch.trees[1].state = TreeState::kRefused;
  batch.trees[1].message = "b.swc:2";

  const Json json = Json::parse(json_text(batch));
  ASSERT_EQ(json["trees"].size(), 2U);
  const Json& a = json["trees"][0];
  EXPECT_EQ(keys(a), (std::vector<std::string>{"name", "input", "state", "exit_code", "branches",
                                               "junctions", "loops", "failed", "solids", "closed",
                                               "valid", "self_intersecting", "volume_mm3",
                                               "max_normal_angle_deg", "seconds", "message"}));
  EXPECT_EQ(a["branches"], 3);
  EXPECT_EQ(a["volume_mm3"].get<double>(), 1.0 / 3.0);  // to the bit
  EXPECT_TRUE(a["max_normal_angle_deg"].is_null());
  const Json& b = json["trees"][1];
  EXPECT_EQ(b["name"], "b \"quoted\"");
  EXPECT_EQ(b["state"], "refused");
  EXPECT_TRUE(b["branches"].is_null());
  EXPECT_TRUE(b["closed"].is_null());
  EXPECT_EQ(json["states"], (Json{{"done", 1}, {"refused", 1}}));
}

TEST(ReportJson, TopologyIsThereOnlyWhereItWasCounted) {
  ThinnedFile thinned;
  thinned.voxels_before = 100;
  thinned.voxels_after = 9;
  thinned.seconds = {{"read", 0.5}, {"thin", 1.5}};
  Json json = Json::parse(json_text(thinned));
  EXPECT_EQ(keys(json), (std::vector<std::string>{"voxels_in", "voxels_out", "seconds"}));
  EXPECT_EQ(json["seconds"]["thin"], 1.5);
  thinned.topology_before = TopologyNumbers{};
  thinned.topology_before->cycles = 2;
  thinned.topology_after = TopologyNumbers{};
  json = Json::parse(json_text(thinned));
  EXPECT_EQ(json["before"]["cycles"], 2);
  EXPECT_EQ(json["after"]["cycles"], 0);
}

TEST(ReportJson, AFitNamesItsUnitAndThePartsThatDidNotComeToRest) {
  FittedFile fitted;
  fitted.wall.emplace();
  fitted.wall->mean_residual_mm = 0.25;
  fitted.iterations = 7;
  fitted.unconverged = {"wall_b"};
  for (const char* name : {"wall_a", "wall_b", "all"}) {
    fitted.parts.emplace_back();
    fitted.parts.back().name = name;
    fitted.parts.back().residual_mean = 0.25;
  }
  Json json = Json::parse(json_text(fitted));
  EXPECT_EQ(json["iterations"], 7);
  EXPECT_EQ(json["converged"], false);
  EXPECT_EQ(json["residual_force"]["unit"], "mm");
  EXPECT_EQ(json["fit"]["method"], "wall");
  EXPECT_EQ(json["fit"]["mean_residual_mm"], 0.25);
  ASSERT_EQ(json["parts"].size(), 2U);
  EXPECT_EQ(json["parts"][0]["converged"], true);
  EXPECT_EQ(json["parts"][1]["converged"], false);
  EXPECT_FALSE(json.contains("dice"));

  fitted.wall.reset();
  fitted.edges.emplace();
  fitted.truth.emplace();
  fitted.truth->dice = 0.5;
  json = Json::parse(json_text(fitted));
  EXPECT_EQ(json["residual_force"]["unit"], "potential");
  EXPECT_EQ(json["fit"]["method"], "sparse");
  EXPECT_EQ(json["dice"], 0.5);
}

TEST(ReportJson, ACertificateHasItsFidelityWhereItIsKnown) {
  EXPECT_FALSE(Json::parse(json_text(Certificate(), std::nullopt)).contains("fidelity"));
  Fidelity fidelity;
  fidelity.sections = 12;
  EXPECT_EQ(Json::parse(json_text(Certificate(), fidelity))["fidelity"]["sections"], 12);
}

}  // namespace
}  // namespace angiospline
