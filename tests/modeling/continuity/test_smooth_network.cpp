#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/build/build_model.h"
#include "modeling/continuity/smooth_network.h"
#include "tests/shapes/network_measures.h"

namespace angiospline {
namespace {

using Outcome = SmoothedPart::Outcome;

// A trunk that parts, and one of its daughters again: two junctions, five bodies.
CenterlineTree small_tree() {
  CenterlineTree tree;
  tree.source = "test";
  for (const Vec3& p : {Vec3(0, 0, 0), Vec3(0, 0, 20), Vec3(12, 0, 34), Vec3(-12, 0, 34),
                        Vec3(18, 12, 48), Vec3(18, -12, 48)}) {
    std::string name("n");
    name.append(std::to_string(tree.nodes.size()));
    tree.nodes.push_back({name, p});
  }
  const auto connect = [&](int from, int to, double radius) {
    CenterlineBranch branch;
    branch.name = tree.nodes[static_cast<std::size_t>(from)].name + "_" +
                  tree.nodes[static_cast<std::size_t>(to)].name;
    branch.from = from;
    branch.to = to;
    constexpr int kPoints = 9;
    branch.points_mm.resize(3, kPoints);
    branch.radii_mm = Eigen::VectorXd::Constant(kPoints, radius);
    const Vec3 a = tree.nodes[static_cast<std::size_t>(from)].position_mm;
    const Vec3 b = tree.nodes[static_cast<std::size_t>(to)].position_mm;
    for (int k = 0; k < kPoints; ++k) branch.points_mm.col(k) = a + k * (b - a) / (kPoints - 1);
    tree.branches.push_back(std::move(branch));
  };
  connect(0, 1, 2.0);
  connect(1, 2, 1.6);
  connect(1, 3, 1.4);
  connect(2, 4, 1.2);
  connect(2, 5, 1.1);
  tree.inlets = {0};
  return tree;
}

class SmoothNetwork : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const Result<Model> model = build_model(small_tree());
    ASSERT_TRUE(model) << model.error().message();
    clean_ = model->network;
  }

  static std::set<int> columns_of(const SurfaceNetwork& network, RegionKind kind) {
    std::set<int> columns;
    for (const Patch& patch : network.patches) {
      if (network.regions[static_cast<std::size_t>(patch.region)].kind == kind) {
        columns.insert(patch.control.begin(), patch.control.end());
      }
    }
    return columns;
  }

  static SurfaceNetwork shaken(const std::set<int>& columns, double size_mm) {
    SurfaceNetwork network = clean_;
    Random random(4);
    for (const int c : columns) {
      for (int d = 0; d < 3; ++d) network.control_points_mm(d, c) += size_mm * random.gaussian();
    }
    apply_dependencies(network);
    return network;
  }

  static SurfaceNetwork clean_;
};

SurfaceNetwork SmoothNetwork::clean_;

TEST_F(SmoothNetwork, LeavesWhatIsCleanToTheLastBit) {
  const auto smoothed = smooth_network(clean_);
  ASSERT_TRUE(smoothed) << smoothed.error().message();
  EXPECT_EQ(smoothed->network.control_points_mm, clean_.control_points_mm);
  ASSERT_EQ(smoothed->parts.size(), clean_.regions.size());
  for (const SmoothedPart& part : smoothed->parts) EXPECT_EQ(part.outcome, Outcome::kClean);
  EXPECT_LT(smoothed->before_deg, 1e-3);
}

TEST_F(SmoothNetwork, MendsJunctionsAndMovesNothingElse) {
  std::set<int> inside = columns_of(clean_, RegionKind::kJunction);
  for (const int c : columns_of(clean_, RegionKind::kBody)) inside.erase(c);
  // The row next to an opening keeps its plane: a fit that moves it is the next test's.
  for (const Patch& patch : clean_.patches) {
    if (clean_.regions[static_cast<std::size_t>(patch.region)].kind != RegionKind::kJunction)
      continue;
    for (std::size_t j = 6; j < 12; ++j) inside.erase(patch.control[j]);
  }
  const SurfaceNetwork rough = shaken(inside, 0.03);
  ASSERT_GT(testing::measure_seams(rough).angle_deg, 1.0);
  const auto smoothed = smooth_network(rough);
  ASSERT_TRUE(smoothed) << smoothed.error().message();
  EXPECT_LT(testing::measure_seams(smoothed->network).angle_deg, 1e-6);
  EXPECT_GT(testing::least_jacobian_ratio(smoothed->network), 0.03);
  int junctions = 0;
  for (std::size_t r = 0; r < smoothed->parts.size(); ++r) {
    const SmoothedPart& part = smoothed->parts[r];
    const bool is_junction = clean_.regions[r].kind == RegionKind::kJunction;
    EXPECT_EQ(part.outcome, is_junction ? Outcome::kSmoothed : Outcome::kClean) << part.name;
    EXPECT_LT(part.moved_mm, is_junction ? 0.5 : 1e-12) << part.name;
    junctions += is_junction;
  }
  EXPECT_EQ(junctions, 2);
}

TEST_F(SmoothNetwork, MendsBodiesAndOpeningsThatWereMovedToo) {
  std::set<int> all = columns_of(clean_, RegionKind::kJunction);
  all.merge(columns_of(clean_, RegionKind::kBody));
  const SurfaceNetwork rough = shaken(all, 0.02);
  ASSERT_GT(testing::measure_seams(rough).angle_deg, 1.0);
  const auto smoothed = smooth_network(rough);
  ASSERT_TRUE(smoothed) << smoothed.error().message();
  for (const SmoothedPart& part : smoothed->parts) {
    EXPECT_EQ(part.outcome, Outcome::kSmoothed) << part.name << ": " << part.why;
  }
  const testing::SeamMeasure seams = testing::measure_seams(smoothed->network);
  EXPECT_LT(seams.angle_deg, 1e-6);
  EXPECT_LT(seams.gap_mm, 1e-12);
  for (const Rim& rim : smoothed->network.rims) {
    for (const Side& side : rim.sides) {
      const Patch& patch = smoothed->network.patches[static_cast<std::size_t>(side.patch)];
      const Vec2 uv = side_parameters(patch, side.side, (side.from + side.to) / 2);
      const Vec3 p = patch_surface(smoothed->network, side.patch).at(uv.x(), uv.y());
      EXPECT_NEAR(rim.normal.dot(p - rim.center_mm), 0, 1e-12);
    }
  }
}

TEST_F(SmoothNetwork, RefusesAJunctionThatFoldsByNameAndSmoothsTheOther) {
  SurfaceNetwork rough = clean_;
  int first = -1;
  for (const Patch& patch : clean_.patches) {
    const Region& region = clean_.regions[static_cast<std::size_t>(patch.region)];
    if (region.kind != RegionKind::kJunction) continue;
    if (first < 0) first = patch.region;
    // Of the first junction one patch is turned inside out, of the other a point is moved.
    const Vec3 shift(0.05, 0.03, 0.02);
    if (patch.region != first) {
      rough.control_points_mm.col(patch.control[28]) += shift;
      break;
    }
    rough.control_points_mm.col(patch.control[28]) *= 1.5;
  }
  const auto smoothed = smooth_network(rough);
  ASSERT_TRUE(smoothed) << smoothed.error().message();
  const SmoothedPart& refused = smoothed->parts[static_cast<std::size_t>(first)];
  EXPECT_EQ(refused.outcome, Outcome::kRefused);
  EXPECT_FALSE(refused.why.empty());
  int smoothed_junctions = 0;
  for (std::size_t r = 0; r < smoothed->parts.size(); ++r) {
    smoothed_junctions += clean_.regions[r].kind == RegionKind::kJunction &&
                          smoothed->parts[r].outcome == Outcome::kSmoothed;
  }
  EXPECT_EQ(smoothed_junctions, 1);
  for (const Patch& patch : clean_.patches) {
    if (patch.region != first) continue;
    for (const int c : patch.control) {
      EXPECT_EQ(smoothed->network.control_points_mm.col(c), rough.control_points_mm.col(c));
    }
  }
}

TEST_F(SmoothNetwork, NamesTheDefectOfABrokenNetwork) {
  SurfaceNetwork broken = clean_;
  broken.control_points_mm(0, 3) = std::numeric_limits<double>::quiet_NaN();
  const auto smoothed = smooth_network(broken);
  ASSERT_FALSE(smoothed);
  EXPECT_EQ(smoothed.error().kind, ErrorKind::kBadInput);
}

TEST_F(SmoothNetwork, StopsOnRequest) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  SmoothNetworkOptions options;
  options.everything = true;
  const auto smoothed = smooth_network(clean_, options, progress);
  ASSERT_FALSE(smoothed);
  EXPECT_EQ(smoothed.error().kind, ErrorKind::kCancelled);
}

}  // namespace
}  // namespace angiospline
