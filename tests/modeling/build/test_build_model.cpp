#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <set>

#include <gtest/gtest.h>

#include "base/index.h"
#include "base/random.h"
#include "modeling/build/build_model.h"
#include "modeling/build/make_room.h"
#include "modeling/build/plan.h"
#include "modeling/build/plan_bends.h"
#include "modeling/check/fidelity.h"
#include "modeling/tree/smooth_centerlines.h"
#include "tests/shapes/network_measures.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;

// Builds trees branch by branch.
struct TreeMaker {
  CenterlineTree tree;

  int node(const Vec3& p, const std::string& name = {}) {
    tree.nodes.push_back({name.empty() ? std::to_string(tree.nodes.size()) : name, p});
    return static_cast<int>(tree.nodes.size()) - 1;
  }

  // A branch along `shape` (0 to 1), from and to nodes whose positions it ends at.
  void branch(int from, int to, double radius, const std::function<Vec3(double)>& shape,
              int points = 20) {
    CenterlineBranch b;
    b.name = tree.nodes[static_cast<std::size_t>(from)].name + "_" +
             tree.nodes[static_cast<std::size_t>(to)].name;
    b.from = from;
    b.to = to;
    b.points_mm.resize(3, points + 1);
    for (int i = 0; i <= points; ++i) b.points_mm.col(i) = shape(static_cast<double>(i) / points);
    b.points_mm.col(0) = tree.nodes[static_cast<std::size_t>(from)].position_mm;
    b.points_mm.rightCols<1>() = tree.nodes[static_cast<std::size_t>(to)].position_mm;
    b.radii_mm = Eigen::VectorXd::Constant(points + 1, radius);
    tree.branches.push_back(std::move(b));
  }

  void line(int from, int to, double radius) {
    const Vec3 a = tree.nodes[static_cast<std::size_t>(from)].position_mm;
    const Vec3 b = tree.nodes[static_cast<std::size_t>(to)].position_mm;
    branch(from, to, radius, [=](double t) { return Vec3((1 - t) * a + t * b); });
  }
};

TreeMaker bifurcation() {
  TreeMaker maker;
  const int root = maker.node({0, 0, -12}, "root");
  const int middle = maker.node({0, 0, 0}, "middle");
  const int left = maker.node({-8, 0, 9}, "left");
  const int right = maker.node({7, 2, 10}, "right");
  maker.line(root, middle, 1.5);
  maker.line(middle, left, 1.1);
  maker.line(middle, right, 1.2);
  maker.tree.inlets = {root};
  return maker;
}

std::set<std::string> rim_names(const SurfaceNetwork& network) {
  std::set<std::string> names;
  for (const Rim& rim : network.rims) names.insert(rim.name);
  return names;
}

std::set<std::string> region_names(const SurfaceNetwork& network) {
  std::set<std::string> names;
  for (const Region& region : network.regions) names.insert(region.name);
  return names;
}

void expect_smooth(const SurfaceNetwork& network) {
  const testing::SeamMeasure seams = testing::measure_seams(network, 9);
  EXPECT_GT(seams.samples, 0);
  EXPECT_LT(seams.gap_mm, 1e-11);
  EXPECT_LT(seams.angle_deg, 1e-6);
  EXPECT_GT(testing::least_jacobian_ratio(network, 9), 0.02);
}

TEST(SeedModel, ASingleVesselIsOneBodyWithTwoRims) {
  TreeMaker maker;
  const int a = maker.node({0, 0, 0}, "a");
  const int b = maker.node({0, 0, 20}, "b");
  maker.line(a, b, 2);
  maker.tree.inlets = {a};
  const Result<Model> model = build_model(maker.tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_EQ(rim_names(model->network), (std::set<std::string>{"inlet", "outlet_b"}));
  EXPECT_EQ(region_names(model->network), (std::set<std::string>{"wall_a_b"}));
  EXPECT_NEAR(testing::enclosed_volume_mm3(model->network), kPi * 4 * 20, 0.01 * kPi * 80);
  for (const Rim& rim : model->network.rims) {
    EXPECT_NEAR(rim.normal.z(), rim.name == "inlet" ? -1 : 1, 1e-6);
    EXPECT_EQ(rim.kind, rim.name == "inlet" ? RimKind::kInlet : RimKind::kOutlet);
  }
}

// Straight, half a circle of the given bend radius, straight back: the course of a siphon.
TreeMaker siphon(double radius, double bend, double leg) {
  TreeMaker maker;
  const int a = maker.node({0, 0, 0}, "a");
  const int b = maker.node({2 * bend, 0, 0}, "b");
  const double whole = 2 * leg + kPi * bend;
  const auto shape = [=](double t) {
    const double s = t * whole;
    if (s < leg) return Vec3(0, 0, s);
    if (s > leg + kPi * bend) return Vec3(2 * bend, 0, whole - s);
    const double angle = (s - leg) / bend;
    return Vec3(bend * (1 - std::cos(angle)), 0, leg + bend * std::sin(angle));
  };
  maker.branch(a, b, radius, shape, 80);
  return maker;
}

TEST(SeedModel, ATightBendKeepsItsCourseAndItsVolume) {
  for (const double bend : {1.5, 1.8, 3.0}) {  // in radii
    const double radius = 2;
    const TreeMaker maker = siphon(radius, bend * radius, 12);
    const Result<Model> model = build_model(maker.tree);
    ASSERT_TRUE(model) << model.error().message();
    for (const std::string& text : texts_of(model->warnings)) {
      EXPECT_EQ(text.find("leaves its centerline"), std::string::npos) << text;
    }
    const double length = 24 + kPi * bend * radius;
    EXPECT_NEAR(testing::enclosed_volume_mm3(model->network) / (kPi * radius * radius * length), 1,
                0.05)
        << "bend " << bend;
  }
}

TEST(SeedModel, ABendTighterThanItsRadiusIsWarnedOf) {
  const Result<Model> model = build_model(siphon(2, 0.8, 12).tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_FALSE(model->warnings.empty());
}

TEST(SeedModel, ABifurcationHasItsNamesAndIsSmoothEverywhere) {
  const Result<Model> model = build_model(bifurcation().tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_TRUE(model->failed.empty());
  EXPECT_EQ(rim_names(model->network),
            (std::set<std::string>{"inlet", "outlet_left", "outlet_right"}));
  EXPECT_EQ(region_names(model->network),
            (std::set<std::string>{"junction_middle", "wall_root_middle", "wall_middle_left",
                                   "wall_middle_right"}));
  EXPECT_EQ(model->network.patches.size(), 12u);
  expect_smooth(model->network);
  // More than the thickest branch alone, less than the three laid side by side.
  const double volume = testing::enclosed_volume_mm3(model->network);
  const double sum = kPi * (2.25 * 12 + 1.21 * std::sqrt(145) + 1.44 * std::sqrt(153));
  EXPECT_GT(volume, 0.85 * sum);
  EXPECT_LT(volume, 1.02 * sum);
}

// Two daughters that run side by side; then one turns back sharply.
TreeMaker hooked_fork() {
  const double shared = 2.2;
  const double bend = 0.65;
  const double turn = 2.1;  // radians
  const double length = 16;
  const auto hook = [=](double t) {
    const double s = length * t;
    const double angle = std::clamp((s - shared) / bend, 0.0, turn);
    const double rest = std::max(0.0, s - shared - turn * bend);
    return Vec3(std::min(s, shared) + bend * std::sin(angle) + rest * std::cos(turn),
                -bend * (1 - std::cos(angle)) - rest * std::sin(turn), -0.1 * s);
  };
  TreeMaker maker;
  const int a = maker.node({-12, 0, 0}, "a");
  const int s = maker.node({0, 0, 0}, "s");
  const int b = maker.node({14, 3.5, 2}, "b");
  const int c = maker.node(hook(1), "c");
  maker.line(a, s, 0.58);
  maker.branch(s, b, 0.45, [](double t) { return Vec3(14 * t, 3.5 * t * t, 2 * t); });
  maker.branch(s, c, 0.45, hook, 60);
  maker.tree.inlets = {a};
  return maker;
}

// Radians by which the branch turns away from its opening's axis, half a radius behind it.
double turn_behind(const Plan& plan, int node, std::size_t slot) {
  const PlannedNode& n = plan.nodes[index(node)];
  const PlannedBranch& branch = plan.branches[index(n.ends[slot].branch)];
  const double distance = std::max(n.wanted_mm[slot], n.meets_mm[slot]);
  const double along =
      branch.along_at_distance(n.ends[slot], n.center_mm, distance).value_or(branch.length_mm());
  const double step = n.spec.branches[slot].radius_mm / 2;
  const double sign = n.ends[slot].at_end ? -1 : 1;
  const double from = n.ends[slot].at_end ? branch.length_mm() - along : along;
  const Vec3 way = (branch.at(from + sign * step) - branch.at(from)).head<3>();
  return std::acos(std::clamp(way.normalized().dot(n.spec.branches[slot].direction), -1.0, 1.0));
}

TEST(Plan, LetsABranchBendInsideItsJunctionWhereItWouldTurnBehindItsOpening) {
  const SmoothedTree smooth = smooth_centerlines(hooked_fork().tree).value();
  Plan plan = make_plan(smooth, {});
  find_bends(plan);
  const auto worst = [&] {
    double largest = 0;
    for (std::size_t k = 0; k < 3; ++k) largest = std::max(largest, turn_behind(plan, 1, k));
    return largest;
  };
  const double before = worst();
  Plan again = plan;
  EXPECT_TRUE(bend(again, {0, kBendAlternatives, 0, 0}).empty());
  ASSERT_EQ(bend(plan, {0, 0, 0, 0}), std::vector<int>{1});
  EXPECT_LT(worst(), before - 0.2);

  const Model model = build_smoothed(smooth).value();
  EXPECT_TRUE(model.failed.empty());
  expect_smooth(model.network);
}

TEST(SeedModel, WithoutInletsRimsAreCaps) {
  CenterlineTree tree = bifurcation().tree;
  tree.inlets.clear();
  const Result<Model> model = build_model(tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_EQ(rim_names(model->network),
            (std::set<std::string>{"cap_root", "cap_left", "cap_right"}));
}

TEST(SeedModel, ScalesWithItsInput) {
  // By a power of two, so that no rounding tells the two apart.
  constexpr double kScale = 1.0 / 1024;
  const Result<SmoothedTree> tree = smooth_centerlines(bifurcation().tree);
  ASSERT_TRUE(tree);
  SmoothedTree tiny = *tree;
  for (CenterlineNode& node : tiny.tree.nodes) node.position_mm *= kScale;
  for (std::size_t b = 0; b < tiny.paths.size(); ++b) {
    tiny.tree.branches[b].points_mm *= kScale;
    tiny.tree.branches[b].radii_mm *= kScale;
    const BSplineCurve<4>& path = tree->paths[b];
    std::vector<double> knots = path.knots().knots();
    for (double& t : knots) t *= kScale;
    tiny.paths[b] = BSplineCurve<4>(*KnotVector::make(5, knots), kScale * path.control_points());
  }
  const Result<Model> one = build_smoothed(*tree);
  const Result<Model> small = build_smoothed(tiny);
  ASSERT_TRUE(one && small);
  ASSERT_EQ(one->network.control_points_mm.cols(), small->network.control_points_mm.cols());
  EXPECT_LT((one->network.control_points_mm - small->network.control_points_mm / kScale)
                .cwiseAbs()
                .maxCoeff(),
            1e-9);
}

TEST(SeedModel, ARingWithoutJunctionsIsATorus) {
  TreeMaker maker;
  const int a = maker.node({10, 0, 0}, "a");
  maker.branch(
      a, a, 2,
      [](double t) { return Vec3(10 * std::cos(2 * kPi * t), 10 * std::sin(2 * kPi * t), 0); }, 60);
  const Result<Model> model = build_model(maker.tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_TRUE(model->network.rims.empty());
  EXPECT_EQ(model->network.patches.size(), 4u);
  expect_smooth(model->network);
  EXPECT_NEAR(testing::enclosed_volume_mm3(model->network) / (2 * kPi * kPi * 10 * 4), 1, 0.01);
}

TEST(SeedModel, ARingOfFourJunctionsKeepsItsLoop) {
  TreeMaker maker;
  std::vector<int> ring;
  for (int k = 0; k < 4; ++k) {
    const double a = kPi * k / 2;
    ring.push_back(maker.node({15 * std::cos(a), 15 * std::sin(a), 0}));
  }
  for (int k = 0; k < 4; ++k) {
    const double a = kPi * k / 2;
    maker.branch(ring[static_cast<std::size_t>(k)], ring[static_cast<std::size_t>((k + 1) % 4)], 1,
                 [=](double t) {
                   const double b = a + kPi * t / 2;
                   return Vec3(15 * std::cos(b), 15 * std::sin(b), 0);
                 });
  }
  for (int k = 0; k < 4; ++k) {
    const double a = kPi * k / 2;
    const int tip = maker.node({25 * std::cos(a), 25 * std::sin(a), 3});
    maker.line(ring[static_cast<std::size_t>(k)], tip, 0.8);
  }
  const Result<Model> model = build_model(maker.tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_TRUE(model->failed.empty());
  EXPECT_EQ(model->network.rims.size(), 4u);
  EXPECT_EQ(model->network.regions.size(), 12u);
  expect_smooth(model->network);
}

TEST(SeedModel, JunctionsTooNearEachOtherBecomeOneAndSaySo) {
  TreeMaker maker;
  const int root = maker.node({0, 0, -12}, "root");
  const int a = maker.node({0, 0, 0}, "a");
  const int b = maker.node({0.3, 0, 0.8}, "b");
  maker.line(root, a, 1.5);
  maker.line(a, b, 1.2);
  maker.line(a, maker.node({-9, 0, 7}, "p"), 1.0);
  maker.line(b, maker.node({9, 3, 6}, "q"), 1.0);
  maker.line(b, maker.node({2, -10, 5}, "s"), 1.0);
  const Result<Model> model = build_model(maker.tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_TRUE(model->failed.empty());
  EXPECT_TRUE(region_names(model->network).contains("junction_a+b"));
  EXPECT_TRUE(std::any_of(model->warnings.begin(), model->warnings.end(), [](const auto& w) {
    return w.text.find("a and b became one") != std::string::npos;
  }));
  EXPECT_EQ(model->network.rims.size(), 4u);
  expect_smooth(model->network);
}

// Four forks a radius apart along a trunk become one junction of six branches, most of which begin
// well beside its centre.
TEST(SeedModel, ManyJunctionsTooNearEachOtherBecomeOneOfSixBranches) {
  TreeMaker maker;
  const int root = maker.node({0, 0, -16}, "root");
  const Vec3 sides[] = {{12, 0, -2}, {0, 12, -1}, {-12, 0, 1}, {0, -12, 2}};
  int before = root;
  for (int k = 0; k < 4; ++k) {
    const Vec3 place(0, 0, 1.2 * k);
    const int fork = maker.node(place, std::string(1, static_cast<char>('a' + k)));
    maker.line(before, fork, 1.2);
    maker.line(fork, maker.node(place + sides[k], "side" + std::to_string(k)), 0.8);
    before = fork;
  }
  maker.line(before, maker.node({0, 0, 18}, "tip"), 1.0);
  maker.tree.inlets = {root};
  const Result<Model> model = build_model(maker.tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_TRUE(model->failed.empty());
  EXPECT_EQ(model->network.rims.size(), 6u);
  EXPECT_EQ(model->network.regions.size(), 7u);
  expect_smooth(model->network);
}

// Forks every radius and a half along a thick trunk: each leaves the next too little length.
TreeMaker crowded_trunk(int forks) {
  TreeMaker maker;
  int before = maker.node({0, 0, -16}, "root");
  maker.tree.inlets = {before};
  for (int k = 0; k < forks; ++k) {
    const Vec3 place(0, 0, 2.25 * k);
    const double angle = 2.4 * k;
    const int fork = maker.node(place, "fork" + std::to_string(k));
    maker.line(before, fork, 1.5);
    const Vec3 side(11 * std::cos(angle), 11 * std::sin(angle), 5);
    maker.line(fork, maker.node(place + side, "side" + std::to_string(k)), 1.0);
    before = fork;
  }
  maker.line(before, maker.node({0, 0, 2.25 * forks + 16}, "tip"), 1.5);
  return maker;
}

TEST(RoomMaker, CutsAJunctionWhereTheLeastIsLackingAndThinsVesselsThere) {
  const SmoothedTree tree = smooth_centerlines(crowded_trunk(10).tree).value();
  const Plan plan = make_plan(tree, {});
  const auto largest = [](const Plan& p) {
    return *std::max_element(
        p.nodes.begin(), p.nodes.end(),
        [](const PlannedNode& a, const PlannedNode& b) { return a.ends.size() < b.ends.size(); });
  };
  const PlannedNode before = largest(plan);
  ASSERT_GT(before.ends.size(), 6U);

  RoomMaker room(tree);
  EXPECT_EQ(room.tree().warnings, tree.warnings);
  for (int round = 0; round < 12; ++round) {
    const PlannedNode now = largest(make_plan(room.tree(), {}));
    if (now.ends.size() <= 6) break;
    ASSERT_TRUE(room.cut(now));
  }
  const SmoothedTree made = room.tree();
  EXPECT_LE(largest(make_plan(made, {})).ends.size(), 6U);
  int thinned = 0;
  for (std::size_t b = 0; b < tree.paths.size(); ++b) {
    const double length = tree.paths[b].knots().last();
    bool any = false;
    for (int k = 0; k <= 50; ++k) {
      const Vec4 was = tree.paths[b].at(length * k / 50);
      const Vec4 is = made.paths[b].at(length * k / 50);
      EXPECT_LT((was - is).head<3>().norm(), 1e-9);
      EXPECT_GT(is(3), 0.39 * was(3));
      EXPECT_LT(is(3), (1 + 1e-9) * was(3));
      any = any || is(3) < 0.99 * was(3);
      // The ends of the tree are far from what is lacking.
      if (tree.tree.branches[b].name == "root_fork0" && length * k / 50 < 6) {
        EXPECT_NEAR(is(3), was(3), 1e-5);
      }
    }
    if (!any) continue;
    ++thinned;
    const std::string start = "branch " + tree.tree.branches[b].name + " was thinned";
    EXPECT_TRUE(std::any_of(made.warnings.begin(), made.warnings.end(), [&](const auto& warning) {
      return warning.text.rfind(start, 0) == 0;
    })) << start;
  }
  EXPECT_GT(thinned, 0);
}

TEST(SeedModel, ACrowdedTrunkIsOneNetworkAndSaysWhatWasThinned) {
  const Result<BuiltModel> seeded =
      build_with_room(smooth_centerlines(crowded_trunk(10).tree).value());
  ASSERT_TRUE(seeded) << seeded.error().message();
  EXPECT_TRUE(seeded->model.failed.empty());
  EXPECT_EQ(seeded->model.network.rims.size(), 12U);
  expect_smooth(seeded->model.network);
  const auto& warnings = seeded->model.warnings;
  EXPECT_TRUE(std::any_of(warnings.begin(), warnings.end(), [](const Warning& warning) {
    return warning.text.find("was thinned to") != std::string::npos;
  }));
  // The walls follow the tree as it was thinned.
  const Fidelity f = measure_fidelity(seeded->model.network, seeded->tree);
  EXPECT_GT(f.sections, 50);
  EXPECT_LT(f.largest_radius_error, 0.05);
}

// A trunk with two forks; `spoil` makes the second one impossible.
Result<Model> forked_tree(const std::function<void(TreeMaker&, int)>& spoil) {
  TreeMaker maker;
  const int root = maker.node({0, 0, -14}, "root");
  const int good = maker.node({0, 0, 0}, "good");
  const int bad = maker.node({-9, 0, 12}, "bad");
  maker.line(root, good, 1.5);
  maker.line(good, maker.node({10, 0, 10}, "right"), 1.2);
  maker.line(good, bad, 1.1);
  spoil(maker, bad);
  maker.tree.inlets = {root};
  return build_model(maker.tree);
}

// The model has all but the impossible, and names that in a failure, a warning or an assumption.
void expect_the_rest(const Result<Model>& model, const std::vector<std::string>& named) {
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_TRUE(region_names(model->network).contains("junction_good"));
  EXPECT_TRUE(region_names(model->network).contains("wall_good_right"));
  expect_smooth(model->network);
  std::string said;
  for (const FailedPart& part : model->failed) said += part.name + ": " + part.why + "\n";
  for (const std::string& text : texts_of(model->warnings)) said += text + "\n";
  for (const std::string& text : model->assumptions) said += text + "\n";
  for (const std::string& word : named) {
    EXPECT_NE(said.find(word), std::string::npos) << word << " is not in: " << said;
  }
}

TEST(SeedModel, TwoBranchesInTheSameDirectionAreNamedAndTheRestIsThere) {
  expect_the_rest(forked_tree([](TreeMaker& maker, int bad) {
                    maker.line(bad, maker.node({-18, 0, 24}, "a"), 0.9);
                    maker.line(bad, maker.node({-18.01, 0, 24}, "b"), 0.8);
                  }),
                  {"bad_b"});
}

std::size_t times_named(const std::vector<Warning>& warnings, const std::string& name) {
  return static_cast<std::size_t>(std::count_if(
      warnings.begin(), warnings.end(),
      [&](const Warning& warning) { return warning.text.find(name) != std::string::npos; }));
}

// A tunnel that noise left in a mask at a fork: its way round is no longer than the lumen is wide.
TEST(SeedModel, ALoopWithinTheLumensOfItsJunctionIsLeftOutAndNamedOnce) {
  for (const bool fork : {true, false}) {
    const Result<Model> model = forked_tree([fork](TreeMaker& maker, int bad) {
      maker.line(bad, maker.node({-16, 0, 24}, "a"), 0.9);
      if (fork) maker.line(bad, maker.node({-18, 4, 14}, "b"), 0.8);
      const Vec3 at = maker.tree.nodes[static_cast<std::size_t>(bad)].position_mm;
      maker.branch(bad, bad, 0.3, [at](double t) {  // out and back as a hairpin
        const double a = 2 * kPi * t;
        return Vec3(at + Vec3(0.8 * (1 - std::cos(a)), 0.3 * std::sin(a), 0.2 * std::sin(a)));
      });
    });
    expect_the_rest(model, {});
    EXPECT_TRUE(model->failed.empty()) << model->failed[0].why;
    EXPECT_EQ(times_named(model->warnings, "bad_bad"), 1U);
    EXPECT_EQ(times_named(model->warnings, "loop that lies inside its junction"), 1U);
    EXPECT_EQ(model->network.rims.size(), fork ? 4U : 3U);
  }
}

// Strands of a lumen that noise has torn: three ways between junctions that are too near for an
// opening at each end.
TEST(SeedModel, StrandsOfATornLumenAreLeftOutAndNamed) {
  Random random(54);
  TreeMaker maker;
  const double length = random.uniform(6, 8);
  const int a = maker.node({0, 0, 0}, "a");
  const int b = maker.node({0, 0, length}, "b");
  maker.tree.inlets = {maker.node({random.uniform(-10, 10), random.uniform(5, 15), -40}, "root")};
  maker.line(maker.tree.inlets[0], a, random.uniform(1.5, 2.6));
  for (int k = 0; k < 3; ++k) {
    const double side = k == 0 ? 0.01 : random.uniform(k == 1 ? 3 : 0, 5);
    const double angle = random.uniform(0, 2 * kPi);
    const double radius = k == 1 ? random.uniform(1.5, 2.2) : random.uniform(0.7, 1.3);
    maker.branch(a, b, radius, [=](double t) {
      const double away = side * std::sin(kPi * t);
      return Vec3(away * std::cos(angle), away * std::sin(angle), length * t);
    });
  }
  maker.line(b, maker.node({-8, 9, length + 12}, "tip"), random.uniform(0.8, 1.4));
  const Result<Model> model = build_model(maker.tree);
  ASSERT_TRUE(model) << model.error().message();
  EXPECT_TRUE(model->failed.empty()) << model->failed[0].why;
  EXPECT_EQ(rim_names(model->network), (std::set<std::string>{"inlet", "outlet_tip"}));
  EXPECT_GE(times_named(model->warnings, "a_b"), 1U);
  expect_smooth(model->network);
}

TEST(SeedModel, ABranchThatRunsBackThroughItsJunctionIsNamedAndTheRestIsThere) {
  expect_the_rest(forked_tree([](TreeMaker& maker, int bad) {
                    maker.line(bad, maker.node({-16, 0, 24}, "a"), 0.9);
                    maker.line(bad, maker.node({-3, 0, 4}, "b"), 0.8);
                  }),
                  {"bad_b"});
}

TEST(SeedModel, ABranchWithoutRadiusIsNamedAndTheRestIsThere) {
  for (const double radius : {0.0, -0.5, std::numeric_limits<double>::quiet_NaN()}) {
    const Result<Model> model = forked_tree([radius](TreeMaker& maker, int bad) {
      maker.line(bad, maker.node({-16, 0, 24}, "a"), 0.9);
      maker.line(bad, maker.node({-16, 8, 16}, "b"), 0.8);
      maker.tree.branches.back().radii_mm(7) = radius;
    });
    expect_the_rest(model, {"branch bad_b (bad to b), point 7", "radius is not positive"});
    // The other branches of its node are there, as one vessel.
    EXPECT_EQ(rim_names(model->network),
              (std::set<std::string>{"inlet", "outlet_right", "outlet_a"}));
    EXPECT_FALSE(region_names(model->network).contains("junction_bad"));
  }
}

TEST(SeedModel, OnlyBranchesWithoutRadiusAreAnError) {
  TreeMaker maker;
  maker.line(maker.node({0, 0, 0}, "a"), maker.node({0, 0, 9}, "b"), 0.0);
  const Result<Model> model = build_model(maker.tree);
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().kind, ErrorKind::kBadInput);
  EXPECT_NE(model.error().message().find("branch a_b (a to b), point 0: radius is not positive: 0"),
            std::string::npos)
      << model.error().message();
}

// Leaves to one side, goes round a circle, comes back through the fork's middle and goes on.
TEST(SeedModel, ACurvedBranchThatLoopsBackThroughItsJunctionIsNamedAndTheRestIsThere) {
  expect_the_rest(forked_tree([](TreeMaker& maker, int bad) {
                    maker.line(bad, maker.node({-16, 0, 24}, "a"), 0.9);
                    const Vec3 start = maker.tree.nodes[static_cast<std::size_t>(bad)].position_mm;
                    const Vec3 side(0, 1, 0);
                    const Vec3 away = Vec3(0.8, 0, 0.6);
                    const auto shape = [&](double t) {
                      constexpr double kLoop = 0.75;  // of the way; then straight on
                      if (t > kLoop) return Vec3(start + 9 * (t - kLoop) / (1 - kLoop) * side);
                      const double a = 2 * kPi * t / kLoop;
                      return Vec3(start + 5 * (std::sin(a) * side + (1 - std::cos(a)) * away));
                    };
                    maker.branch(bad, maker.node(shape(1.0), "b"), 0.8, shape, 60);
                  }),
                  {"bad_b"});
}

TEST(SeedModel, RandomTreesAreSmoothAndNameWhatFailed) {
  Random random(11);
  int junctions = 0;
  int failed = 0;
  for (int trial = 0; trial < 4; ++trial) {
    TreeMaker maker;
    struct Tip {
      int node;
      Vec3 direction;
      double radius;
    };
    const int root = maker.node({0, 0, 0});
    std::vector<Tip> tips{{root, Vec3(0, 0, 1), 2.0}};
    for (int level = 0; level < 3; ++level) {
      std::vector<Tip> next;
      for (const Tip& tip : tips) {
        const Vec3 start = maker.tree.nodes[static_cast<std::size_t>(tip.node)].position_mm;
        const int end = maker.node(start + tip.radius * random.uniform(10, 16) * tip.direction);
        maker.line(tip.node, end, tip.radius);
        if (level == 2) continue;
        const Vec3 side = (tip.direction.unitOrthogonal() * random.gaussian() +
                           tip.direction.cross(tip.direction.unitOrthogonal()) * random.gaussian())
                              .normalized();
        for (const double sign : {-1.0, 1.0}) {
          const double angle = random.uniform(0.5, 0.9);
          next.push_back({end, std::cos(angle) * tip.direction + sign * std::sin(angle) * side,
                          tip.radius * random.uniform(0.6, 0.85)});
        }
      }
      tips = std::move(next);
    }
    const Result<Model> model = build_model(maker.tree);
    ASSERT_TRUE(model) << model.error().message();
    expect_smooth(model->network);
    failed += static_cast<int>(model->failed.size());
    junctions += 3;
  }
  EXPECT_EQ(junctions, 12);
  EXPECT_EQ(failed, 0);
}

TEST(SeedModel, StopsWhenAsked) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  const Result<Model> model = build_model(bifurcation().tree, {}, progress);
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().kind, ErrorKind::kCancelled);
}

}  // namespace
}  // namespace angiospline
