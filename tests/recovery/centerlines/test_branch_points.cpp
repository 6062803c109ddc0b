// The points of a graph's branches, and the radii along them: a straight vessel and a fork.
#include <cmath>

#include <gtest/gtest.h>

#include "recovery/centerlines/branch_points.h"
#include "recovery/centerlines/branch_radii.h"
#include "recovery/centerlines/centerlines_from_graph.h"
#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {
namespace {

struct Traced {
  Mask mask;
  VesselGraph graph;
};

Traced traced(PhantomKind kind) {
  const Phantom phantom = make_phantom(kind).value();
  return {phantom.truth, vessels_from_mask(phantom.truth).value().graph};
}

TEST(BranchPoints, ShareTheNodesOfTheirGraph) {
  const Traced t = traced(PhantomKind::kBifurcation);
  const BranchPoints points = branch_points(t.graph, t.mask, TipRule::kSkeleton);
  ASSERT_EQ(points.chains.size(), t.graph.arcs.size());
  std::size_t inner = 0;
  for (std::size_t a = 0; a < t.graph.arcs.size(); ++a) {
    const std::vector<int>& u = points.chains[a].unknowns;
    EXPECT_EQ(u.front(), t.graph.arcs[a].from);
    EXPECT_EQ(u.back(), t.graph.arcs[a].to);
    EXPECT_EQ(u.size(), t.graph.arcs[a].voxels.size());
    inner += u.size() - 2;
  }
  EXPECT_EQ(static_cast<std::size_t>(points.at_mm.cols()), t.graph.nodes.size() + inner);
  EXPECT_EQ(points.at_mm, points.voxels_mm);
  // Some of them lie in the junction's lumen, most do not.
  const auto count = std::count(points.in_junction.begin(), points.in_junction.end(), true);
  EXPECT_GT(count, 3);
  EXPECT_LT(count, points.at_mm.cols() / 2);
}

TEST(BranchPoints, LoseTheTailsThatBendIntoTheCornersOfACut) {
  const Traced t = traced(PhantomKind::kCylinder);
  const BranchPoints whole = branch_points(t.graph, t.mask, TipRule::kSkeleton);
  const BranchPoints kept = branch_points(t.graph, t.mask, TipRule::kFlatCap);
  ASSERT_EQ(kept.chains.size(), 1U);
  EXPECT_LT(kept.chains[0].unknowns.size(), whole.chains[0].unknowns.size());
  EXPECT_GE(5 * kept.chains[0].unknowns.size(), whole.chains[0].unknowns.size());
}

TEST(BranchPoints, AreClearOfAJunctionOnlyBeyondTheirReach) {
  const Traced t = traced(PhantomKind::kBifurcation);
  const BranchPoints points = branch_points(t.graph, t.mask, TipRule::kFlatCap);
  const Eigen::Index n = points.at_mm.cols();
  const auto clear = [&](double reach) {
    const auto all = clear_of_junctions(points, Eigen::VectorXd::Constant(n, reach));
    return std::count(all.begin(), all.end(), true);
  };
  const auto outside = n - std::count(points.in_junction.begin(), points.in_junction.end(), true);
  EXPECT_EQ(clear(1e-9), outside);
  EXPECT_LT(clear(5), clear(1e-9));
  EXPECT_EQ(clear(1e9), 0);
}

TEST(BranchTangents, AreUnitVectorsAlongAStraightVessel) {
  const Traced t = traced(PhantomKind::kCylinder);
  const BranchPoints points = branch_points(t.graph, t.mask, TipRule::kFlatCap);
  const Points3 tangents = branch_tangents(t.graph, points);
  for (const int u : points.chains[0].unknowns) {
    EXPECT_NEAR(tangents.col(u).norm(), 1, 1e-12);
    EXPECT_GT(std::abs(tangents(2, u)), 0.6);
  }
}

TEST(RadiiAlong, CorrectClosedSectionsByCountsAndBridgeOpenOnes) {
  const Traced t = traced(PhantomKind::kCylinder);
  BranchPoints points = branch_points(t.graph, t.mask, TipRule::kSkeleton);
  const Eigen::Index n = points.at_mm.cols();
  points.radius_mm = Eigen::VectorXd::Constant(n, 8);
  points.counted = Eigen::VectorXd::Constant(n, 1.25);
  const std::vector<int>& u = points.chains[0].unknowns;
  points.radius_mm(u[u.size() / 2]) = 0;       // open
  points.radius_mm(u[u.size() / 2 + 3]) = 80;  // an outlier
  const Eigen::VectorXd radii = radii_along(t.graph, points, points.chains[0]);
  ASSERT_EQ(radii.size(), std::ssize(u));
  EXPECT_LT((radii.array() - 10).abs().maxCoeff(), 1e-9);
}

TEST(RadiiAlong, AreTheDistancesToTheWallWhereNoSectionIsClosed) {
  const Traced t = traced(PhantomKind::kCylinder);
  BranchPoints points = branch_points(t.graph, t.mask, TipRule::kSkeleton);
  points.counted = Eigen::VectorXd::Zero(points.at_mm.cols());
  const Eigen::VectorXd radii = radii_along(t.graph, points, points.chains[0]);
  // From the centre of a voxel beside the axis to that of the last voxel inside and half a voxel
  // on.
  EXPECT_NEAR(radii(radii.size() / 2), 10, 1.2);
}

}  // namespace
}  // namespace angiospline
