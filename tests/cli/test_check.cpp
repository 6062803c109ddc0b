// angiospline check --json: the same figures from a native model and from CAD files of it.
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

constexpr const char* kTree =
    "1 3 0 0 -14 1.5 -1\n2 3 0 0 -7 1.5 1\n3 3 0 0 0 1.5 2\n4 3 5 0 5 1.2 3\n5 3 10 0 10 1.2 4\n"
    "6 3 -4.5 0 6 1.1 3\n7 3 -9 0 12 1.1 6\n";

TEST(Check, GivesEveryFigureOfANativeModelAndOfCadFiles) {
  const TemporaryFolder folder;
  const ProgramRun seed = run_angiospline({"seed", folder.write("y.swc", kTree), "-o",
                                           folder / "y.json", folder / "y.step", folder / "y.igs"});
  ASSERT_EQ(seed.exit_code, 0) << seed.err;
  double volume_mm3 = 0;
  for (const char* file : {"y.json", "y.step", "y.igs"}) {
    const ProgramRun run = run_angiospline({"check", folder / file, "--json"});
    ASSERT_EQ(run.exit_code, 0) << file << ": " << run.err;
    const auto json = nlohmann::json::parse(run.out);
    for (const char* key :
         {"solids", "closed", "valid", "self_intersecting", "volume_mm3", "area_mm2",
          "bounding_box_mm", "faces", "smooth_edges", "free_edges", "max_gap_mm",
          "max_normal_angle_deg", "worst_edge", "min_jacobian_ratio", "min_jacobian_face",
          "max_curvature_times_radius", "genus"}) {
      EXPECT_TRUE(json.contains(key)) << file << ": " << key;
    }
    EXPECT_EQ(json["solids"], 1) << file;
    EXPECT_EQ(json["closed"], true) << file;
    EXPECT_EQ(json["valid"], true) << file;
    EXPECT_EQ(json["self_intersecting"], false) << file;
    EXPECT_EQ(json["faces"].size(), 15U) << file;  // 12 patches and 3 caps
    EXPECT_GE(json["smooth_edges"].get<int>(), 21) << file;
    EXPECT_EQ(json["free_edges"], 0) << file;
    EXPECT_EQ(json["genus"], 0) << file;
    EXPECT_LT(json["max_gap_mm"].get<double>(), 1e-6) << file;
    EXPECT_LT(json["max_normal_angle_deg"].get<double>(), 1e-5) << file;
    EXPECT_EQ(json["worst_edge"].size(), 2U) << file;
    EXPECT_GT(json["min_jacobian_ratio"].get<double>(), 0.1) << file;
    // Radii are known to the native model only.
    const bool is_native = std::string(file) == "y.json";
    EXPECT_EQ(json["max_curvature_times_radius"].is_number(), is_native) << file;
    if (is_native) volume_mm3 = json["volume_mm3"];
    EXPECT_NEAR(json["volume_mm3"].get<double>(), volume_mm3, 1e-6 * volume_mm3) << file;
  }
}

}  // namespace
}  // namespace angiospline::test
