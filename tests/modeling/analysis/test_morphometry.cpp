#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "modeling/analysis/morphometry.h"

namespace angiospline {
namespace {

// A helix of radius 3 and pitch 8 with `turns` turns, its vessel's radius going from r0 to r1.
CenterlineBranch helix(double turns, double r0, double r1, Eigen::Index points) {
  CenterlineBranch branch{"h", 0, 1, Points3(3, points), Eigen::VectorXd(points)};
  for (Eigen::Index k = 0; k < points; ++k) {
    const double t = static_cast<double>(k) / static_cast<double>(points - 1);
    const double angle = 2 * std::numbers::pi * turns * t;
    branch.points_mm.col(k) = Vec3(3 * std::cos(angle), 3 * std::sin(angle), 8 * turns * t);
    branch.radii_mm[k] = r0 + t * (r1 - r0);
  }
  return branch;
}

TEST(Morphometry, OfAHelixIsThatOfTheCurve) {
  const BranchMorphometry m = morphometry(helix(2, 1, 2, 4001));
  EXPECT_NEAR(m.length_mm, 2 * std::hypot(2 * std::numbers::pi * 3, 8), 1e-4);
  EXPECT_NEAR(m.mean_radius_mm, 1.5, 1e-10) << "all steps are of one length";
  EXPECT_EQ(m.min_radius_mm, 1.0);
  EXPECT_EQ(m.max_radius_mm, 2.0);
}

TEST(Morphometry, MeanRadiusCountsLengthsAndNotPoints) {
  // A cylinder of 9 mm at radius 1 that widens linearly to 3 over the last millimetre; many points
  // where it is wide must not pull the mean.
  CenterlineBranch branch{"b", 0, 1, Points3(3, 12), Eigen::VectorXd(12)};
  branch.points_mm.setZero();
  branch.points_mm(2, 1) = 9;
  branch.radii_mm.head(2).setOnes();
  for (Eigen::Index k = 2; k < 12; ++k) {
    const double t = static_cast<double>(k - 1) / 10;
    branch.points_mm(2, k) = 9 + t;
    branch.radii_mm[k] = 1 + 2 * t;
  }
  const BranchMorphometry m = morphometry(branch);
  EXPECT_NEAR(m.length_mm, 10, 1e-12);
  EXPECT_NEAR(m.mean_radius_mm, (9 * 1 + 1 * 2) / 10.0, 1e-12);
  EXPECT_GT(branch.radii_mm.mean(), 1.7) << "the mean of the points is another";
}

TEST(Morphometry, OfABranchReadBackwardsIsTheSame) {
  const CenterlineBranch forth = helix(1.3, 0.5, 2.5, 57);
  CenterlineBranch back = forth;
  back.points_mm = forth.points_mm.rowwise().reverse();
  back.radii_mm = forth.radii_mm.reverse();
  EXPECT_NEAR(morphometry(back).length_mm, morphometry(forth).length_mm, 1e-12);
  EXPECT_NEAR(morphometry(back).mean_radius_mm, morphometry(forth).mean_radius_mm, 1e-12);
}

TEST(Morphometry, ABranchWithoutLengthHasTheMeanOfItsPoints) {
  CenterlineBranch branch{"b", 0, 1, Points3::Ones(3, 2), Eigen::VectorXd(2)};
  branch.radii_mm << 1, 2;
  const BranchMorphometry m = morphometry(branch);
  EXPECT_EQ(m.length_mm, 0.0);
  EXPECT_EQ(m.mean_radius_mm, 1.5);
}

TEST(Morphometry, ArcLengthsRunFromZeroToTheLengthInGrowingSteps) {
  const CenterlineBranch branch = helix(2, 1, 2, 101);
  const Eigen::VectorXd s = arc_lengths_mm(branch);
  ASSERT_EQ(s.size(), 101);
  EXPECT_EQ(s[0], 0.0);
  EXPECT_EQ(s[100], morphometry(branch).length_mm);
  const double step = s[100] / 100;
  for (Eigen::Index k = 1; k < s.size(); ++k) EXPECT_NEAR(s[k] - s[k - 1], step, 1e-12);
}

}  // namespace
}  // namespace angiospline
