#include <algorithm>
#include <utility>

#include <gtest/gtest.h>

#include "recovery/thesis/smoothing/thesis_smoothing.h"
#include "recovery/thesis/smoothing/triple_smoothing.h"

namespace angiospline {
namespace {

class TripleSmoothing : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    auto model = thesis_bifurcation();
    ASSERT_TRUE(model) << model.error().message();
    model_ = std::move(*model);
  }
  static ThesisBifurcation model_;
};

ThesisBifurcation TripleSmoothing::model_;

TEST_F(TripleSmoothing, StartsFromTheThesissBifurcationOfWhichSixBoundariesAreRough) {
  EXPECT_EQ(model_.network.patches.size(), 12u);
  EXPECT_EQ(model_.network.joins.size(), 21u);
  for (int j = 0; j < 21; ++j) {
    const bool rough = std::find(model_.rough.begin(), model_.rough.end(), j) != model_.rough.end();
    if (rough) {
      EXPECT_GT(join_angle_deg(model_.network, j), 0.1) << j;
    } else {
      EXPECT_LT(join_angle_deg(model_.network, j), 1e-3) << j;
    }
  }
}

TEST_F(TripleSmoothing, MakesTheSixRoughBoundariesSmoothAndMovesOnlyWhatIsBesideThem) {
  SurfaceNetwork network = model_.network;
  const auto reports = smooth_by_triple_curves(network, {model_.rough});
  ASSERT_TRUE(reports) << reports.error().message();
  const TripleSystemReport& report = reports->front();
  EXPECT_EQ(report.boundaries, 6);
  EXPECT_EQ(report.constraints, 6 * 15);  // order 15 on one span: 15 nodes
  EXPECT_LT(report.independent, report.constraints);
  EXPECT_EQ(report.unknowns, 3 * report.distances);
  EXPECT_EQ(report.ending, TripleEnding::kSmooth);
  EXPECT_LE(report.after_deg, 0.01);
  for (const int j : model_.rough) EXPECT_LE(join_angle_deg(network, j), 0.01);
  int moved = 0;
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    moved += network.control_points_mm.col(c) != model_.network.control_points_mm.col(c);
  }
  EXPECT_GT(moved, 0);
  EXPECT_LE(moved, report.distances);
  EXPECT_LT(report.moved_mm, 0.2);
}

TEST_F(TripleSmoothing, SolvesTheTessellationsTwoSystemsSideBySideWhenBoundariesFloat) {
  ThesisTessellation cut = tessellated(model_);
  ASSERT_EQ(cut.systems.size(), 2u);
  ASSERT_FALSE(find_defect(cut.network)) << find_defect(cut.network)->message();
  const auto reports = smooth_by_triple_curves(cut.network, cut.systems);
  ASSERT_TRUE(reports) << reports.error().message();
  for (const TripleSystemReport& report : *reports) {
    EXPECT_EQ(report.constraints, 45);
    EXPECT_LE(report.after_deg, 0.01);
  }
}

TEST_F(TripleSmoothing, LeavesASystemThatHasNoSolutionAsItWasAndSaysWhy) {
  ThesisTessellation cut = tessellated(model_);
  const Points3 before = cut.network.control_points_mm;
  TripleSmoothingOptions options;
  options.floating = false;
  options.most_evaluations = 40;
  const auto reports = smooth_by_triple_curves(cut.network, cut.systems, options);
  ASSERT_TRUE(reports);
  for (const TripleSystemReport& report : *reports) {
    EXPECT_NE(report.ending, TripleEnding::kSmooth);
    EXPECT_EQ(report.fixed, 6);  // both ends of three held curves
    EXPECT_GT(report.fixed_residual, 0.01);
    EXPECT_GT(report.fixed_angle_deg, 0.5);
    EXPECT_LE(report.fixed_angle_deg, report.before_deg);
  }
  EXPECT_EQ(cut.network.control_points_mm, before);
}

TEST_F(TripleSmoothing, SolvesTheTessellationWithBoundariesHeldOnceItsCornersAreLevel) {
  ThesisTessellation cut = tessellated(model_);
  const double levelled = flatten_corners(cut);
  EXPECT_GT(levelled, 1e-4);
  EXPECT_LT(levelled, 0.05);
  EXPECT_LT(flatten_corners(cut), 1e-3 * levelled);
  ASSERT_FALSE(find_defect(cut.network));
  const SurfaceNetwork level = cut.network;
  TripleSmoothingOptions options;
  options.floating = false;
  const auto reports = smooth_by_triple_curves(cut.network, cut.systems, options);
  ASSERT_TRUE(reports) << reports.error().message();
  for (const TripleSystemReport& report : *reports) {
    EXPECT_EQ(report.constraints, 45);
    EXPECT_EQ(report.fixed, 6);
    EXPECT_LT(report.fixed_residual, 1e-12);
    EXPECT_LT(report.fixed_angle_deg, 1e-6);
    EXPECT_GT(report.before_deg, 0.5);
    EXPECT_EQ(report.ending, TripleEnding::kSmooth);
    EXPECT_LE(report.after_deg, 0.01);
  }
  // The boundaries are where they were.
  for (const std::vector<int>& joins : cut.systems) {
    for (const int j : joins) {
      const std::vector<int>& control =
          level.patches[static_cast<std::size_t>(level.joins[static_cast<std::size_t>(j)].a.patch)]
              .control;
      for (std::size_t i = 5; i < control.size(); i += 6) {
        EXPECT_EQ(cut.network.control_points_mm.col(control[i]),
                  level.control_points_mm.col(control[i]));
      }
    }
  }
}

TEST_F(TripleSmoothing, RefusesBoundariesThatAreNotThereAndSystemsThatShareAPoint) {
  SurfaceNetwork network = model_.network;
  const auto none = smooth_by_triple_curves(network, {{99}});
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message().find("join 99"), std::string::npos);
  const auto shared = smooth_by_triple_curves(network, {model_.rough, model_.rough});
  ASSERT_FALSE(shared);
  EXPECT_NE(shared.error().message().find("share a control point"), std::string::npos);
  EXPECT_EQ(network.control_points_mm, model_.network.control_points_mm);
}

}  // namespace
}  // namespace angiospline
