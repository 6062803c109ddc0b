#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "modeling/check/fidelity.h"
#include "modeling/solid/solid.h"
#include "modeling/tree/keep_apart.h"
#include "modeling/tree/overlaps.h"

namespace angiospline {
namespace {

// A branch with `count` points of a curve (x, y, z, radius) over [0, 1].
template <typename Curve>
CenterlineBranch branch_along(const std::string& name, int from, int to, const Curve& curve,
                              int count = 60) {
  CenterlineBranch branch{name, from, to, Points3(3, count), Eigen::VectorXd(count)};
  for (int i = 0; i < count; ++i) {
    const Vec4 p = curve(static_cast<double>(i) / (count - 1));
    branch.points_mm.col(i) = p.head<3>();
    branch.radii_mm(i) = p(3);
  }
  return branch;
}

CenterlineTree tree_of(std::vector<CenterlineBranch> branches) {
  CenterlineTree tree;
  for (CenterlineBranch& branch : branches) {
    branch.from = static_cast<int>(tree.nodes.size());
    tree.nodes.push_back({branch.name + "0", branch.points_mm.col(0)});
    branch.to = static_cast<int>(tree.nodes.size());
    tree.nodes.push_back({branch.name + "1", branch.points_mm.rightCols<1>()});
    tree.branches.push_back(std::move(branch));
  }
  tree.inlets = {0};
  return tree;
}

CenterlineTree bent_tree() {
  return tree_of({branch_along("a", 0, 0, [](double t) {
    return Vec4(30 * t, 4 * std::sin(5 * t), 2 * t * t, 1.2 - 0.4 * t);
  })});
}

TEST(Fidelity, AFineModelIsWithinAPercentOfItsRadiiAndOnItsAxis) {
  const SmoothedTree smooth = smooth_centerlines(bent_tree()).value();
  const Model model = build_smoothed(smooth).value();
  const Fidelity f = measure_fidelity(model.network, smooth);
  EXPECT_GT(f.sections, 20);
  EXPECT_EQ(f.missed, 0);
  EXPECT_LT(f.mean_radius_error, 0.002);
  EXPECT_LT(f.largest_radius_error, 0.01);
  EXPECT_LT(f.largest_axis_offset, 0.02);
}

// A model against a tree with other radii, and beside it.
TEST(Fidelity, SeesAWrongRadiusAndAnAxisThatIsOff) {
  SmoothedTree smooth = smooth_centerlines(bent_tree()).value();
  const Model model = build_smoothed(smooth).value();
  Eigen::Matrix4Xd points = smooth.paths[0].control_points();
  points.row(3) *= 1.1;
  points.row(2).array() += 0.3;
  smooth.paths[0] = BSplineCurve<4>(smooth.paths[0].knots(), points);
  const Fidelity f = measure_fidelity(model.network, smooth);
  EXPECT_NEAR(f.mean_radius_error, 1 - 1 / 1.1, 0.003);
  EXPECT_NEAR(f.largest_axis_offset, 0.3 / (1.1 * 0.8), 0.05);
  EXPECT_EQ(f.largest_error_branch, "a");
}

TEST(Fidelity, StatesWhatSmoothingMoved) {
  CenterlineTree tree = bent_tree();
  for (Eigen::Index i = 1; i + 1 < tree.branches[0].points_mm.cols(); i += 2) {
    tree.branches[0].points_mm(2, i) += 0.2;  // a zigzag
  }
  const SmoothedTree smooth = smooth_centerlines(tree).value();
  const Fidelity f = measure_fidelity(build_smoothed(smooth)->network, smooth);
  EXPECT_GT(f.largest_move_mm, 0.05);
  EXPECT_LE(f.largest_move_radii, 0.5 + 1e-6);
}

CenterlineTree crossing_tree(double distance) {
  return tree_of(
      {branch_along("a", 0, 0, [](double t) { return Vec4(40 * t, 0, 0, 1); }),
       branch_along("b", 0, 0, [&](double t) { return Vec4(20, 40 * t - 20, distance, 0.8); })});
}

TEST(Fidelity, StatesWhatTheClearanceMovedApartFromSmoothing) {
  const SmoothedTree smooth = smooth_centerlines(crossing_tree(1.6)).value();
  const SmoothedTree apart = keep_apart(smooth, {0.1, 0.5, 0.5});
  const Fidelity f = measure_fidelity(build_smoothed(apart)->network, apart);
  EXPECT_LT(f.largest_move_radii, 0.01);  // straight lines: nothing to smooth
  EXPECT_GT(f.largest_clearance_move_radii, 0.1);
  EXPECT_LE(f.largest_clearance_move_radii, 0.5 + 1e-6);
  EXPECT_NEAR(f.largest_total_move_radii, f.largest_clearance_move_radii, 0.02);
  EXPECT_EQ(f.largest_total_move_branch, f.largest_clearance_move_branch);

  const Fidelity before = measure_fidelity(build_smoothed(smooth)->network, smooth);
  EXPECT_EQ(before.largest_clearance_move_radii, 0);
  EXPECT_EQ(before.largest_total_move_radii, before.largest_move_radii);
}

TEST(KeepApart, MovesVesselsThatTouchToTheClearanceAndLeavesOthersAlone) {
  const SmoothedTree before = smooth_centerlines(crossing_tree(1.6)).value();
  ASSERT_EQ(find_overlaps(before).size(), 1U);
  const SmoothedTree after = keep_apart(before, {0.1, 0.5, 0.5});
  EXPECT_TRUE(find_overlaps(after, {0.1}).empty());
  for (std::size_t b = 0; b < 2; ++b) {
    const double last = after.paths[b].knots().last();
    for (const double part : {0.0, 0.5, 1.0}) {
      EXPECT_NEAR(after.paths[b].at(part * last)(3), before.paths[b].at(part * last)(3), 1e-9);
    }
    EXPECT_LT((after.paths[b].at(0) - before.paths[b].at(0)).norm(), 1e-9);
  }
  const SmoothedTree apart = smooth_centerlines(crossing_tree(3.0)).value();
  EXPECT_EQ(keep_apart(apart).paths[0].control_points(), apart.paths[0].control_points());
}

// A jagged file has used up most of what vessels may move before they are kept apart; the way back
// to where the file had them is free.
TEST(KeepApart, LeavesNoPointFartherThanHalfARadiusFromWhereTheFileHadIt) {
  const auto jagged = [](double t) { return 0.42 * std::sin(5000 * t); };
  CenterlineTree tree =
      tree_of({branch_along("a", 0, 0, [&](double t) { return Vec4(40 * t, 0, jagged(t), 1); }),
               branch_along("b", 0, 0, [&](double t) {
                 return Vec4(20, 40 * t - 20, 1.5 + 0.8 * jagged(t), 0.8);
               })});
  const SmoothedTree smooth = smooth_centerlines(tree).value();
  ASSERT_FALSE(find_overlaps(smooth).empty());
  const SmoothedTree apart = keep_apart(smooth, {0.1});
  EXPECT_TRUE(find_overlaps(apart, {0.1}).empty());
  const Fidelity f = measure_fidelity(build_smoothed(apart)->network, apart);
  EXPECT_GT(f.largest_move_radii, 0.2);
  EXPECT_GT(f.largest_clearance_move_radii, 0.1);
  EXPECT_LT(f.largest_total_move_radii, 0.5);
}

// Centerlines that nearly meet would have to move by more than half a radius each.
TEST(KeepApart, ThinsWhatMovingAloneCannotPart) {
  const SmoothedTree before = smooth_centerlines(crossing_tree(0.5)).value();
  const SmoothedTree after = keep_apart(before, {0.1, 0.5, 0.5});
  for (const Overlap& left : find_overlaps(after, {0.1}))
    ADD_FAILURE() << overlap_text(after, left);
  int named = 0;
  for (const std::string& text : texts_of(after.warnings)) {
    named += text.find("was thinned to") != std::string::npos ? 1 : 0;
  }
  EXPECT_EQ(named, 2);
  const auto solid = make_solid(build_smoothed(after)->network);
  ASSERT_TRUE(solid);
  const auto certificate = certify(*solid);
  EXPECT_FALSE(certificate->self_intersecting);
  EXPECT_EQ(certificate->solids, 2);
}

TEST(SeedModel, ExtendsInletsAndOutletsByNamedRoundTubes) {
  BuildOptions options;
  options.extend_inlets = 2.0;
  options.extend_outlets = 5.0;
  const CenterlineTree tree =
      tree_of({branch_along("a", 0, 0, [](double t) { return Vec4(0, 0, 10 * t, 1); })});
  const Model model = build_model(tree, options).value();
  ASSERT_EQ(model.network.regions.size(), 3U);
  std::vector<std::string> names;
  for (const Region& region : model.network.regions) names.push_back(region.name);
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"extension_inlet", "extension_outlet_a1", "wall_a"}));
  ASSERT_EQ(model.network.rims.size(), 2U);
  for (const Rim& rim : model.network.rims) {
    EXPECT_NEAR(rim.center_mm.z(), rim.kind == RimKind::kInlet ? -4.0 : 20.0, 1e-6);
    EXPECT_NEAR(rim.radius_mm, 1.0, 0.01);
  }
  const auto certificate = certify(make_solid(model.network).value());
  ASSERT_TRUE(certificate);
  EXPECT_TRUE(certificate->closed && certificate->valid && !certificate->self_intersecting);
  EXPECT_NEAR(certificate->volume_mm3, 24 * 3.14159265, 0.5);
  EXPECT_LT(certificate->max_normal_angle_deg, 1e-6);
}

}  // namespace
}  // namespace angiospline
