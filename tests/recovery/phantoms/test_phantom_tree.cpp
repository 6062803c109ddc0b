// Random trees: the laws they are grown by.
#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "recovery/phantoms/phantom_tree.h"

namespace angiospline {
namespace {

TEST(RandomTree, SharesRadiiByMurraysLawAtEveryBifurcation) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    PhantomOptions options;
    options.seed = seed;
    options.ends = 20;
    const CenterlineTree tree = random_tree(options).value();
    std::map<int, double> in, out;  // cubes of radii at each node
    int ends = 0;
    for (const CenterlineBranch& b : tree.branches) {
      in[b.to] += std::pow(b.radii_mm(b.radii_mm.size() - 1), 3);
      out[b.from] += std::pow(b.radii_mm(0), 3);
      EXPECT_GE(b.radii_mm.minCoeff(), options.radius_min_mm);
    }
    for (const auto& [node, cubes] : in) {
      if (out.contains(node)) {
        EXPECT_NEAR(out[node], cubes, 1e-9 * cubes);
      } else {
        ++ends;
      }
    }
    EXPECT_EQ(ends, 20);
    EXPECT_EQ(std::ssize(tree.branches), 2 * 20 - 1);
  }
}

TEST(RandomTree, KeepsTheGapBetweenBranchesThatDoNotMeet) {
  PhantomOptions options;
  options.ends = 16;
  const CenterlineTree tree = random_tree(options).value();
  int looked_at = 0;
  for (std::size_t a = 0; a < tree.branches.size(); ++a) {
    for (std::size_t b = a + 1; b < tree.branches.size(); ++b) {
      const CenterlineBranch &one = tree.branches[a], &other = tree.branches[b];
      if (one.from == other.from || one.from == other.to || one.to == other.from) continue;
      for (Eigen::Index i = 0; i < one.points_mm.cols(); ++i) {
        for (Eigen::Index k = 0; k < other.points_mm.cols(); ++k) {
          const double apart = (one.points_mm.col(i) - other.points_mm.col(k)).norm();
          EXPECT_GE(apart, one.radii_mm(i) + other.radii_mm(k) + 3);
          ++looked_at;
        }
      }
    }
  }
  EXPECT_GT(looked_at, 1000);
}

TEST(RandomTree, IsTheSameForTheSameSeed) {
  PhantomOptions options;
  options.ends = 8;
  const CenterlineTree a = random_tree(options).value(), b = random_tree(options).value();
  options.seed = 2;
  const CenterlineTree c = random_tree(options).value();
  EXPECT_EQ(a.branches.back().points_mm, b.branches.back().points_mm);
  EXPECT_NE(a.nodes.back().position_mm, c.nodes.back().position_mm);
}

}  // namespace
}  // namespace angiospline
