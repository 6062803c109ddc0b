#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/network/mesh_spacing.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

// Integral of the polyline through values at equal steps of [0, 1], from 0 to t.
double integral_to(const std::vector<double>& density, double t) {
  const auto steps = static_cast<double>(density.size() - 1);
  double sum = 0;
  for (std::size_t k = 1; k < density.size(); ++k) {
    const double low = static_cast<double>(k - 1) / steps;
    const double share = std::clamp((t - low) * steps, 0.0, 1.0);
    const double at = density[k - 1] + share * (density[k] - density[k - 1]);
    sum += share * (density[k - 1] + at) / 2 / steps;
  }
  return sum;
}

TEST(Density, IsThePolylineAndGoesOnAsAConstant) {
  const Density d{{1, 2, 4}, {10, 20, 0}};
  EXPECT_DOUBLE_EQ(d(1.5), 15);
  EXPECT_DOUBLE_EQ(d(3), 10);
  EXPECT_DOUBLE_EQ(d(-7), 10);
  EXPECT_DOUBLE_EQ(d(9), 0);
  EXPECT_DOUBLE_EQ(d.integral(), 15 + 20);
}

TEST(Equidistribute, GivesEachSegmentTheSameShareOfTheIntegral) {
  Random random(11);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> density(200);
    // Linear inside each step but sampled as a constant share: smooth enough to compare loosely.
    const double a = random.uniform(1, 30), b = random.uniform(1, 30);
    for (std::size_t k = 0; k < density.size(); ++k) {
      density[k] = a + (b - a) * static_cast<double>(k) / 199;
    }
    const std::vector<double> samples = equidistribute(density, 3);
    const double all = integral_to(density, 1);
    ASSERT_GE(samples.size(), 4U);
    EXPECT_EQ(samples.size() - 1, static_cast<std::size_t>(std::max(3.0, std::ceil(all - 1e-6))));
    EXPECT_EQ(samples.front(), 0);
    EXPECT_EQ(samples.back(), 1);
    const double share = all / static_cast<double>(samples.size() - 1);
    for (std::size_t k = 1; k < samples.size(); ++k) {
      EXPECT_NEAR(integral_to(density, samples[k]) - integral_to(density, samples[k - 1]), share,
                  0.01 * share);
    }
  }
}

TEST(Equidistribute, TakesTheLeastNumberWhereLittleIsAsked) {
  const std::vector<double> samples = equidistribute({0.1, 0.1, 0.1}, 4);
  ASSERT_EQ(samples.size(), 5U);
  for (std::size_t k = 0; k < 5; ++k) EXPECT_NEAR(samples[k], 0.25 * static_cast<double>(k), 1e-15);
  EXPECT_EQ(equidistribute({0, 0}, 2), (std::vector<double>{0, 0.5, 1}));
}

// A chord of a circle of radius R that spans h of it is h^2 / 8 R off: pi R / h of them go round
// half of it. Along the tube only the longest edge asks.
TEST(PatchSpacing, OfATubeIsTheChordsAndTheLongestEdges) {
  const TessellationOptions options{.chord_tolerance = 0.01, .longest_edge = 0.75};
  for (const double radius : {0.2, 1.0, 7.0}) {
    const SurfaceNetwork tube = samples::tube(radius, 6 * radius);
    const PatchSpacing spacing = spacing_of(patch_surface(tube, 0), radius, options);
    EXPECT_NEAR(spacing.u.integral(), std::numbers::pi * std::sqrt(1 / (8 * 0.01)), 0.15);
    EXPECT_NEAR(spacing.v.integral(), 6 / 0.75, 0.05);
    EXPECT_EQ(&density_along(spacing, PatchSide::kU1), &spacing.v);
    EXPECT_EQ(&density_along(spacing, PatchSide::kV0), &spacing.u);
  }
}

TEST(NetworkSpacing, CoarsensByATwoDigitToleranceThatNamesItself) {
  const SurfaceNetwork tube = samples::tube();
  const std::vector<BSplineSurface<3>> surfaces{patch_surface(tube, 0), patch_surface(tube, 1)};
  TessellationOptions options{.chord_tolerance = 1e-4, .most_triangles = 2000};
  EXPECT_FALSE(spacing_of(tube, surfaces, options, {}));
  options.coarsen = true;
  const auto coarse = spacing_of(tube, surfaces, options, {});
  ASSERT_TRUE(coarse) << coarse.error().message();
  const double used = coarse->used.chord_tolerance;
  EXPECT_GT(used, options.chord_tolerance);
  const double unit = std::pow(10, std::floor(std::log10(used)) - 1);
  EXPECT_NEAR(used / unit, std::round(used / unit), 1e-6);
  // Edges are bounded by the root of what the tolerance grew by.
  EXPECT_NEAR(coarse->used.longest_edge / options.longest_edge,
              std::sqrt(used / options.chord_tolerance), 1e-9);
}

}  // namespace
}  // namespace angiospline
