// Smoothing on a graph: waves, lines, meeting chains.
#include <cmath>
#include <numbers>
#include <numeric>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/centerlines/axis_smoothing.h"

namespace angiospline {
namespace {

SmoothingChain chain_of(int from, int count) {
  SmoothingChain chain;
  chain.unknowns.resize(static_cast<std::size_t>(count));
  std::iota(chain.unknowns.begin(), chain.unknowns.end(), from);
  return chain;
}

SmoothingData data_of(const Points3& points, double wavelength) {
  return {points, Eigen::VectorXd::Ones(points.cols()),
          Eigen::VectorXd::Constant(points.cols(), wavelength)};
}

// A shallow wave along x.
Points3 wave(int count, double step, double length) {
  Points3 points(3, count);
  for (int k = 0; k < count; ++k) {
    const double x = step * k;
    points.col(k) = Vec3(x, 0.01 * std::cos(2 * std::numbers::pi * x / length), 3);
  }
  return points;
}

TEST(SmoothOnGraph, LeavesEvenStraightLinesWhereTheyAre) {
  Points3 points(3, 40);
  for (int k = 0; k < 40; ++k) points.col(k) = Vec3(1, 2, 3) + k * Vec3(0.3, -0.2, 0.5);
  const Points3 smooth = smooth_on_graph({chain_of(0, 40)}, data_of(points, 10));
  EXPECT_LT((smooth - points).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(SmoothOnGraph, HalvesTheStatedWaveAndKeepsTwiceAsLongOnes) {
  for (const auto& [length, share] : {std::pair(12.0, 0.5), std::pair(24.0, 16.0 / 17)}) {
    const Points3 points = wave(1200, 0.1, length);
    const Points3 smooth = smooth_on_graph({chain_of(0, 1200)}, data_of(points, 12));
    // Well within, where ends are not felt.
    for (int k = 500; k < 700; ++k) {
      EXPECT_NEAR(smooth(1, k), share * points(1, k), 2e-4);
    }
  }
}

TEST(SmoothOnGraph, CountsSteps) {
  // The same curve on uneven steps comes out the same.
  const Points3 even = wave(601, 0.1, 12);
  std::vector<double> places;
  Random random(9);
  for (double x = 0; x < 60; x += random.uniform(0.04, 0.2)) places.push_back(x);
  Points3 uneven(3, std::ssize(places));
  for (std::size_t k = 0; k < places.size(); ++k) {
    uneven.col(static_cast<Eigen::Index>(k)) =
        Vec3(places[k], 0.01 * std::cos(2 * std::numbers::pi * places[k] / 12), 3);
  }
  const Points3 a = smooth_on_graph({chain_of(0, 601)}, data_of(even, 12));
  const Points3 b =
      smooth_on_graph({chain_of(0, static_cast<int>(uneven.cols()))}, data_of(uneven, 12));
  for (Eigen::Index k = 0; k < b.cols(); ++k) {
    if (b(0, k) < 20 || b(0, k) > 40) continue;
    const auto at = static_cast<Eigen::Index>(std::lround(b(0, k) / 0.1));
    EXPECT_NEAR(b(1, k), a(1, at), 4e-4);
  }
}

TEST(SmoothOnGraph, BridgesWhatCountsForLittle) {
  Points3 points(3, 60);
  for (int k = 0; k < 60; ++k) points.col(k) = Vec3(k, 0, 0);
  SmoothingData data = data_of(points, 12);
  for (int k = 28; k < 32; ++k) {
    data.measured(1, k) = 1.5;
    data.weight(k) = 1e-4;
  }
  EXPECT_LT(smooth_on_graph({chain_of(0, 60)}, data).row(1).cwiseAbs().maxCoeff(), 0.1);
}

TEST(SmoothOnGraph, KeepsChainsTogetherWhereTheyMeet) {
  // Three arms from unknown 0.
  Points3 points(3, 31);
  points.col(0).setZero();
  std::vector<SmoothingChain> chains;
  for (int arm = 0; arm < 3; ++arm) {
    const double angle = 2 * std::numbers::pi * arm / 3;
    SmoothingChain chain = chain_of(1 + 10 * arm, 10);
    chain.unknowns.insert(chain.unknowns.begin(), 0);
    chains.push_back(chain);
    for (int k = 1; k <= 10; ++k) {
      points.col(10 * arm + k) = k * Vec3(std::cos(angle), std::sin(angle), 0);
    }
  }
  const Points3 smooth = smooth_on_graph(chains, data_of(points, 8));
  EXPECT_LT((smooth - points).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(SmoothOnGraph, TakesPointsThatCoincide) {
  Points3 points = Points3::Zero(3, 8);
  for (int k = 4; k < 8; ++k) points.col(k) = Vec3(k, 0, 0);
  EXPECT_TRUE(smooth_on_graph({chain_of(0, 8)}, data_of(points, 6)).allFinite());
  const Points3 one = Points3::Zero(3, 3);
  EXPECT_EQ(smooth_on_graph({chain_of(0, 3)}, data_of(one, 6)), one);
  EXPECT_EQ(smooth_on_graph({}, {Points3(3, 0), {}, {}}).cols(), 0);
}

}  // namespace
}  // namespace angiospline
