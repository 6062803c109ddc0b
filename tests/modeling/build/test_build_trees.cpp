// Whole trees: loops, names that survive edits, threads, and one tree of each kind that files hold.
#include <algorithm>
#include <set>
#include <string>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "benches/tree_families.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "modeling/check/fidelity.h"
#include "modeling/solid/solid.h"

namespace angiospline {
namespace {

const TreeFamily& family(const std::string& name) {
  const auto& all = tree_families();
  return *std::find_if(all.begin(), all.end(), [&](const TreeFamily& f) { return f.name == name; });
}

std::set<std::string> face_names(const SurfaceNetwork& network) {
  std::set<std::string> names;
  for (const Region& region : network.regions) names.insert(region.name);
  for (const Rim& rim : network.rims) names.insert(rim.name);
  return names;
}

Certificate certificate_of(const Model& model) {
  const auto solid = make_solid(model.network);
  EXPECT_TRUE(solid) << solid.error().message();
  return certify(*solid).value();
}

TEST(SeedTrees, OneThreadAndManyGiveTheSameModelToTheBit) {
  Random random(5);
  const CenterlineTree tree = family("thick daughters").make(random);
  const auto with_threads = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return build_model(tree).value();
  };
  const Model one = with_threads(1);
  const Model many = with_threads(4);
  EXPECT_GT(one.network.patches.size(), 25U);
  ASSERT_EQ(one.network.control_points_mm.cols(), many.network.control_points_mm.cols());
  EXPECT_TRUE(
      (one.network.control_points_mm.array() == many.network.control_points_mm.array()).all());
  EXPECT_EQ(face_names(one.network), face_names(many.network));
  EXPECT_EQ(one.warnings, many.warnings);
}

TEST(SeedTrees, ACircleOfWillisKeepsItsLoopAsOneValidSolidOfGenusOne) {
  const CenterlineTree tree = circle_of_willis();
  ASSERT_EQ(cycle_count(tree), 1);
  const Model model = build_model(tree).value();
  EXPECT_TRUE(model.failed.empty());
  const Certificate c = certificate_of(model);
  EXPECT_EQ(c.solids, 1);
  EXPECT_TRUE(c.closed && c.valid);
  EXPECT_FALSE(c.self_intersecting);
  EXPECT_EQ(c.genus, 1);
  EXPECT_LT(c.max_normal_angle_deg, 0.01);
}

TEST(SeedTrees, RingsAndLaddersHaveOneHandleForEachLoop) {
  for (const char* name : {"ring of two", "ring of four", "ladder"}) {
    Random random(3);
    const CenterlineTree tree = family(name).make(random);
    const Model model = build_model(tree).value();
    EXPECT_TRUE(model.failed.empty()) << name;
    const Certificate c = certificate_of(model);
    EXPECT_EQ(c.solids, 1) << name;
    EXPECT_TRUE(c.closed && c.valid) << name;
    EXPECT_GE(cycle_count(tree), 1) << name;
    EXPECT_EQ(c.genus, cycle_count(tree)) << name;
  }
}

// The names of what an edit does not touch are those from before it.
TEST(SeedTrees, NamesSurviveAnEditElsewhere) {
  Random random(8);
  const CenterlineTree tree = family("thick daughters").make(random);
  const std::set<std::string> before = face_names(build_model(tree).value().network);

  // Other branches first: an order of the file is no name.
  CenterlineTree shuffled = tree;
  std::reverse(shuffled.branches.begin(), shuffled.branches.end());
  EXPECT_EQ(face_names(build_model(shuffled).value().network), before);

  // A point moved a little, and one taken out.
  CenterlineTree moved = tree;
  CenterlineBranch& branch = moved.branches[2];
  branch.points_mm.col(3) += Vec3(0.05, 0.02, -0.03);
  const Eigen::Index rest = branch.points_mm.cols() - 6;
  branch.points_mm.middleCols(5, rest) = branch.points_mm.rightCols(rest).eval();
  branch.points_mm.conservativeResize(3, branch.points_mm.cols() - 1);
  branch.radii_mm.segment(5, rest) = branch.radii_mm.tail(rest).eval();
  branch.radii_mm.conservativeResize(branch.radii_mm.size() - 1);
  EXPECT_EQ(face_names(build_model(moved).value().network), before);

  // A twig more, half-way along the last terminal branch: only what it touches has other names.
  CenterlineTree grown = tree;
  const CenterlineBranch last = grown.branches.back();
  const Eigen::Index middle = last.points_mm.cols() / 2;
  const Vec3 place = last.points_mm.col(middle);
  const double radius = last.radii_mm(middle);
  const int split = static_cast<int>(grown.nodes.size());
  grown.nodes.push_back({"new", place});
  grown.nodes.push_back({"tip", place + 8 * radius * Vec3(0.6, -0.8, 0)});
  CenterlineBranch head = last, tail = last, twig = last;
  head.points_mm = last.points_mm.leftCols(middle + 1);
  head.radii_mm = last.radii_mm.head(middle + 1);
  tail.points_mm = last.points_mm.rightCols(last.points_mm.cols() - middle);
  tail.radii_mm = last.radii_mm.tail(last.radii_mm.size() - middle);
  twig.points_mm.resize(3, 2);
  twig.points_mm << place, grown.nodes.back().position_mm;
  twig.radii_mm = Eigen::VectorXd::Constant(2, 0.7 * radius);
  head.to = tail.from = twig.from = split;
  twig.to = split + 1;
  head.name = "head";
  tail.name = "tail";
  twig.name = "twig";
  grown.branches.back() = head;
  grown.branches.push_back(tail);
  grown.branches.push_back(twig);
  const std::set<std::string> after = face_names(build_model(grown).value().network);
  std::vector<std::string> lost;
  std::set_difference(before.begin(), before.end(), after.begin(), after.end(),
                      std::back_inserter(lost));
  EXPECT_EQ(lost, std::vector<std::string>{"wall_" + last.name});
}

// ---------------------------------------------------------------- one tree of each kind

class SeedFamilies : public ::testing::TestWithParam<std::string> {};

TEST_P(SeedFamilies, AreClosedValidSmoothSolidsTrueToTheirTree) {
  const TreeFamily& kind = family(GetParam());
  Random random(20261);
  const CenterlineTree tree = kind.make(random);
  const auto smoothed = smooth_centerlines(tree);
  ASSERT_TRUE(smoothed) << smoothed.error().message();
  const auto seeded = build_with_room(*smoothed);
  ASSERT_TRUE(seeded) << seeded.error().message();
  const Model* const model = &seeded->model;
  for (const FailedPart& part : model->failed) ADD_FAILURE() << part.name << ": " << part.why;
  const Certificate c = certificate_of(*model);
  EXPECT_TRUE(c.closed && c.valid);
  EXPECT_EQ(c.solids, component_count(smoothed->tree));
  EXPECT_EQ(c.genus, cycle_count(smoothed->tree));
  EXPECT_LT(c.max_normal_angle_deg, 0.01);
  EXPECT_GT(c.min_jacobian_ratio, 0.01);
  EXPECT_TRUE(kind.may_touch || !c.self_intersecting);
  const Fidelity f = measure_fidelity(model->network, seeded->tree);
  EXPECT_LT(f.mean_radius_error, 0.01);
  EXPECT_LT(f.largest_radius_error, 0.05) << f.largest_error_branch;
}

// The quick ones; bench_seeding runs all of them, many times.
const std::vector<std::string> kQuick{
    "thick daughters", "short branches",      "hairpin",     "kinks", "helix", "lengths",
    "repeated points", "two points a branch", "trifurcation"};

std::string as_identifier(const ::testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Kinds, SeedFamilies, ::testing::ValuesIn(kQuick), as_identifier);

}  // namespace
}  // namespace angiospline
