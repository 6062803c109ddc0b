// A native model file made smooth again.
#include <algorithm>
#include <string>

#include <gtest/gtest.h>

#include "io/model/model_file.h"
#include "pipeline/build.h"
#include "pipeline/finish_model.h"
#include "pipeline/smooth.h"
#include "tests/cli/run_program.h"

namespace angiospline {
namespace {

constexpr const char* kTube = "1 3 0 0 0 2 -1\n2 3 0 0 10 2 1\n3 3 0 0 20 2 2\n";

TEST(SmoothFile, LeavesACleanModelAsItIs) {
  const test::TemporaryFolder folder;
  const auto built = build_file({folder.write("tube.swc", kTube)}, {folder.path() / "a.json"});
  ASSERT_TRUE(built) << built.error().message();
  const auto smoothed = smooth_file(folder / "a.json", {folder.path() / "b.json"});
  ASSERT_TRUE(smoothed) << smoothed.error().message();
  ASSERT_FALSE(smoothed->parts.empty());
  for (const SmoothedPart& part : smoothed->parts) {
    EXPECT_EQ(part.outcome, SmoothedPart::Outcome::kClean) << part.name;
  }
  EXPECT_TRUE(is_sound(smoothed->certificate));
  EXPECT_EQ(smoothed->files, std::vector<std::string>{folder / "b.json"});
  const auto again = read_model(folder / "b.json");
  ASSERT_TRUE(again);
  EXPECT_EQ(again->network.control_points_mm, built->model.network.control_points_mm);
}

TEST(SmoothFile, SmoothsWhatWasDented) {
  const test::TemporaryFolder folder;
  auto built = build_file({folder.write("tube.swc", kTube)}, {folder.path() / "a.json"});
  ASSERT_TRUE(built);
  Model dented = built->model;
  Points3& points = dented.network.control_points_mm;
  // Every point of the wall away from the rims: alternately out and in by a fiftieth.
  for (Eigen::Index c = 0; c < points.cols(); ++c) {
    if (std::abs(points(2, c) - 10.0) > 6.0) continue;
    points.col(c).head<2>() *= c % 2 == 0 ? 1.02 : 0.98;
  }
  ASSERT_TRUE(write_model(folder / "dented.json", dented));
  const auto smoothed = smooth_file(folder / "dented.json", {folder.path() / "b.json"});
  ASSERT_TRUE(smoothed) << smoothed.error().message();
  EXPECT_GT(smoothed->before_deg, 0.1);
  EXPECT_LT(smoothed->after_deg, 0.01);
  EXPECT_TRUE(std::any_of(smoothed->parts.begin(), smoothed->parts.end(), [](const auto& part) {
    return part.outcome == SmoothedPart::Outcome::kSmoothed;
  }));
}

TEST(SmoothFile, RefusesWhatKnowsNoRegions) {
  const test::TemporaryFolder folder;
  ASSERT_TRUE(build_file({folder.write("tube.swc", kTube)}, {folder.path() / "a.stl"}));
  const auto smoothed = smooth_file(folder / "a.stl", {folder.path() / "b.json"});
  ASSERT_FALSE(smoothed);
  EXPECT_NE(smoothed.error().message().find("not a native model"), std::string::npos);
}

}  // namespace
}  // namespace angiospline
