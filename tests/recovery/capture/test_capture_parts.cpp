// Cross-sections along a branch, what they see, and how smooth their axis comes out.
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/capture/axes.h"
#include "recovery/capture/greys.h"
#include "recovery/capture/levels.h"
#include "recovery/capture/rules.h"
#include "recovery/capture/stations.h"
#include "recovery/imaging/rasterize/shapes.h"

namespace angiospline {
namespace {

// A straight path with a radius, by its length.
BSplineCurve<4> path(const Vec3& from, const Vec3& to, double radius) {
  Eigen::Matrix<double, 4, Eigen::Dynamic> points(4, 2);
  points.col(0) << from, radius;
  points.col(1) << to, radius;
  return BSplineCurve<4>(KnotVector::clamped(1, {0.0, (to - from).norm()}), points);
}

const Vec3 kFrom(20, 20, 2), kTo(20, 20, 38);

Image<float> vessel(double radius, double inside, double outside) {
  ImageGrid grid;
  grid.size = {41, 41, 41};
  Image<float> image =
      coverage(grid, {flat_cylinder(kFrom - Vec3(0, 0, 9), kTo + Vec3(0, 0, 9), radius)});
  for (float& v : image.voxels)
    v = static_cast<float>(outside + (inside - outside) * static_cast<double>(v));
  return image;
}

TEST(SampledBranch, HasEvenSectionsSquareToItsPath) {
  const CaptureBranch branch = sampled_branch(path(kFrom, kTo, 6), 1.0);
  const auto& s = branch.stations;
  // Half a radius apart.
  ASSERT_EQ(s.size(), 13U);
  for (std::size_t k = 0; k < s.size(); ++k) {
    EXPECT_NEAR(s[k].along, 3.0 * static_cast<double>(k), 1e-12);
    EXPECT_LT((s[k].center - (kFrom + s[k].along * Vec3::UnitZ())).norm(), 1e-12);
    EXPECT_NEAR(s[k].radius, 6, 1e-12);
    EXPECT_LT((s[k].tangent - Vec3::UnitZ()).norm(), 1e-12);
    EXPECT_LT((s[k].e1.cross(s[k].e2) - s[k].tangent).norm(), 1e-12);
    EXPECT_NEAR(s[k].direction(1, 4).dot(s[k].e2), 1, 1e-12);
  }
}

TEST(CarryFrames, DoNotTurnAboutABend) {
  // A quarter of a circle in a plane: what is square to the plane stays so.
  std::vector<CaptureStation> stations(30);
  for (std::size_t k = 0; k < stations.size(); ++k) {
    const double a = static_cast<double>(k) / 29 * std::numbers::pi / 2;
    stations[k].center = 10 * Vec3(std::cos(a), std::sin(a), 0);
  }
  carry_frames(stations);
  const double up = stations.front().e1.z();
  for (const CaptureStation& s : stations) {
    EXPECT_NEAR(s.e1.z(), up, 1e-3);
    EXPECT_NEAR(s.e1.dot(s.tangent), 0, 1e-12);
  }
}

TEST(Between, IsOnTheWayToTheNeighbour) {
  const CaptureBranch branch = sampled_branch(path(kFrom, kTo, 6), 1.0);
  EXPECT_LT((between(branch.stations, 3, 0.5).center - (kFrom + Vec3(0, 0, 10.5))).norm(), 1e-12);
  EXPECT_LT((between(branch.stations, 3, -0.25).center - (kFrom + Vec3(0, 0, 8.25))).norm(), 1e-12);
  EXPECT_EQ(between(branch.stations, 0, -0.5).center, kFrom);
}

TEST(FollowClear, TakesTheMoveAndTheGrowthOfTheNearestMeasuredSection) {
  CaptureBranch branch = sampled_branch(path(kFrom, kTo, 6), 1.0);
  for (std::size_t k = 0; k < branch.stations.size(); ++k) {
    branch.stations[k].clear = k >= 4;
    if (k < 4) continue;
    branch.stations[k].center += Vec3(1, 0, 0.3);
    branch.stations[k].radius = 9;
  }
  follow_clear(branch);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_LT((branch.stations[k].center - branch.stations[k].start - Vec3(1, 0, 0)).norm(), 1e-12);
    EXPECT_NEAR(branch.stations[k].radius, 9, 1e-12);
  }
}

TEST(SmoothMoves, KeepEqualMovesAndEvenOutOthers) {
  CaptureBranch branch = sampled_branch(path(kFrom, kTo, 6), 1.0);
  for (CaptureStation& s : branch.stations) s.center += Vec3(0.5, 0, 0);
  branch.stations[6].center += Vec3(0, 4, 0);
  smooth_moves(branch, 1);
  EXPECT_NEAR(branch.stations[6].center.y() - 20, 2, 1e-12);
  EXPECT_NEAR(branch.stations[5].center.y() - 20, 1, 1e-12);
  EXPECT_NEAR(branch.stations[2].center.x() - 20, 0.5, 1e-12);
}

TEST(MovedTree, MovesNodesWithTheirBranchesAndBlendsIntoThem) {
  CenterlineTree tree;
  tree.nodes = {{"a", kFrom}, {"b", kTo}};
  CenterlineBranch b{"ab", 0, 1, Points3(3, 2), Eigen::VectorXd::Constant(2, 6)};
  b.points_mm << kFrom, kTo;
  tree.branches = {b};
  std::vector<CaptureBranch> branches{sampled_branch(path(kFrom, kTo, 6), 1.0)};
  double moved = -1;
  const CenterlineTree same = moved_tree(tree, branches, branches_at_nodes(tree), moved);
  EXPECT_EQ(moved, 0);
  EXPECT_EQ(same.nodes[0].position_mm, kFrom);
  for (CaptureStation& s : branches[0].stations) s.center += Vec3(0, 2, 0);
  const CenterlineTree shifted = moved_tree(tree, branches, branches_at_nodes(tree), moved);
  EXPECT_NEAR(moved, 2, 1e-12);
  EXPECT_LT((shifted.nodes[1].position_mm - kTo - Vec3(0, 2, 0)).norm(), 1e-12);
  EXPECT_EQ(shifted.branches[0].points_mm.cols(), 13);
  EXPECT_LT((shifted.branches[0].points_mm.row(1).array() - 22).abs().maxCoeff(), 1e-12);
}

TEST(MeanOnRing, OfALinearImageIsItsMiddle) {
  ImageGrid grid;
  grid.size = {41, 41, 41};
  Image<float> image(grid);
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    const Voxel v = grid.voxel(i);
    image.voxels[i] = static_cast<float>(3 * v[0] - 2 * v[1] + v[2]);
  }
  const GreyField field(image);
  const CaptureBranch branch = sampled_branch(path(kFrom, kTo, 6), 1.0);
  for (const double radius : {0.0, 2.0, 7.0}) {
    EXPECT_NEAR(mean_on_ring(field, branch.stations[5], radius), 20 + branch.stations[5].center.z(),
                1e-3);
  }
  CaptureStation far = branch.stations[5];
  far.center += Vec3(500, 0, 0);
  EXPECT_TRUE(std::isnan(mean_on_ring(field, far, 2)));
}

TEST(OutsideOf, DoesNotSeeAnotherVesselBesideIt) {
  ImageGrid grid;
  grid.size = {41, 41, 41};
  Image<float> image =
      coverage(grid, {flat_cylinder(kFrom, kTo, 5),
                      flat_cylinder(kFrom + Vec3(12, 0, 0), kTo + Vec3(12, 0, 0), 5)});
  const GreyField field(image);
  const CaptureBranch branch = sampled_branch(path(kFrom, kTo, 5), 1.0);
  EXPECT_NEAR(outside_of(field, branch.stations[6]), 0, 0.02);
  EXPECT_NEAR(inside_of(field, branch.stations[6]), 1, 0.02);
}

TEST(DiscAt, CoversItsCircleWithCellsOfEqualArea) {
  const Image<float> image = vessel(5, 1000, 0);
  const GreyField field(image);
  const CaptureBranch branch = sampled_branch(path(kFrom, kTo, 5), 1.0);
  const Disc disc = disc_at(field, branch, 6, 1.0);
  EXPECT_NEAR(disc.radius, capture_rules::kDiscRadii * 5 + capture_rules::kDiscVox, 1e-12);
  EXPECT_NEAR(static_cast<double>(disc.cells.size()) * disc.cell_area,
              std::numbers::pi * disc.radius * disc.radius, 0.05 * 346);
  // Its moments are the vessel's.
  double area = 0;
  Vec2 moment = Vec2::Zero();
  for (const Disc::Cell& cell : disc.cells) {
    area += cell.grey / 1000 * disc.cell_area;
    moment += cell.grey / 1000 * disc.cell_area * cell.at;
  }
  EXPECT_NEAR(area, std::numbers::pi * 25, 2);
  EXPECT_LT((moment / area).norm(), 0.05);
}

TEST(TwoLevels, AreTheMeansOfBothPartsOrNone) {
  Random random(6);
  std::vector<double> greys;
  for (int k = 0; k < 300; ++k) greys.push_back(10 + random.gaussian());
  for (int k = 0; k < 100; ++k) greys.push_back(50 + random.gaussian());
  const WallLevels levels = two_levels(greys);
  EXPECT_NEAR(levels.inside, 50, 0.5);
  EXPECT_NEAR(levels.outside, 10, 0.5);
  // One grey in a hundred is no part.
  std::vector<double> few(greys.begin(), greys.begin() + 300);
  few.push_back(1000);
  EXPECT_EQ(two_levels(few).contrast(), 0);
  EXPECT_EQ(two_levels({}).contrast(), 0);
}

TEST(Evidence, IsOneOnTheWallAndNoneAwayFromIt) {
  const Image<float> image = vessel(6, 900, 100);
  const GreyField field(image);
  const WallLevels common{900, 100};
  CaptureBranch on = sampled_branch(path(kFrom, kTo, 6), 1.0);
  CaptureBranch wide = sampled_branch(path(kFrom, kTo, 12), 1.0);
  set_evidence(field, common, on);
  set_evidence(field, common, wide);
  EXPECT_GT(on.evidence, 0.85);
  EXPECT_LT(std::abs(wide.evidence), 0.05);
  for (CaptureStation& s : on.stations) s.clear = false;
  set_evidence(field, common, on);
  EXPECT_EQ(on.evidence, 1);
}

TEST(Levels, AreTheImagesWhereTheyCanBeMeasuredAndTheCommonOnesElsewhere) {
  const Image<float> image = vessel(6, 900, 100);
  const GreyField field(image);
  std::vector<CaptureBranch> branches{sampled_branch(path(kFrom, kTo, 6), 1.0)};
  measure_levels(field, branches[0]);
  for (const WallLevels& l : branches[0].levels) {
    EXPECT_NEAR(l.inside, 900, 10);
    EXPECT_NEAR(l.outside, 100, 10);
  }
  const WallLevels common = levels_of_stations(branches);
  EXPECT_NEAR(common.contrast(), 800, 15);
  branches[0].levels[3] = {500, 499};
  branches[0].levels[4].inside = std::nan("");
  fill_levels(common, branches[0]);
  EXPECT_EQ(branches[0].levels[3].inside, common.inside);
  EXPECT_EQ(branches[0].levels[4].outside, common.outside);
  EXPECT_NEAR(noise_around(field, branches), 0, 5);
}

TEST(LookAround, FindsTheVesselBesideAPathInDiscsThatReachIt) {
  const Image<float> image = vessel(4, 1000, 0);
  const GreyField field(image);
  const Vec3 beside(11, 0, 0);
  const std::vector<CaptureBranch> off{sampled_branch(path(kFrom + beside, kTo + beside, 2), 1.0)};
  const std::vector<CaptureBranch> on{sampled_branch(path(kFrom, kTo, 4), 1.0)};
  EXPECT_EQ(look_around(field, on).reach, 1);
  EXPECT_GT(look_around(field, off).reach, 1);
  EXPECT_GT(look_around(field, off).levels.contrast(), 500);
}

AxisSections noisy_arc(double noise, std::uint64_t seed) {
  constexpr int kCount = 60;
  AxisSections s{Points3(3, kCount), Eigen::VectorXd(kCount), std::vector<char>(kCount, 1), 2};
  Random random(seed);
  for (int k = 0; k < kCount; ++k) {
    const double a = static_cast<double>(k) / 40;
    s.along_mm(k) = 30 * a;
    s.centers_mm.col(k) = 30 * Vec3(std::cos(a), std::sin(a), 0) +
                          noise * Vec3(random.gaussian(), random.gaussian(), random.gaussian());
  }
  return s;
}

TEST(SmoothAxes, TakeNoiseFromAnArcAndKeepItsBend) {
  const AxisSections noisy = noisy_arc(0.2, 11), exact = noisy_arc(0, 1);
  const Points3 smooth = smooth_axes({noisy})[0];
  const double before = (noisy.centers_mm - exact.centers_mm).norm();
  EXPECT_LT((smooth - exact.centers_mm).norm(), 0.5 * before);
  // The sagitta of the arc is kept to a few hundredths of the noise it was found through.
  EXPECT_LT((smooth.col(30) - exact.centers_mm.col(30)).norm(), 0.12);
}

TEST(SmoothAxes, LeaveBranchesOfFewSectionsAsTheyAre) {
  AxisSections few = noisy_arc(0.2, 3);
  for (std::size_t k = 7; k < few.measured.size(); ++k) few.measured[k] = 0;
  EXPECT_EQ(smooth_axes({few})[0], few.centers_mm);
  EXPECT_NE(smooth_axes({noisy_arc(0.2, 3)})[0], few.centers_mm);
}

}  // namespace
}  // namespace angiospline
