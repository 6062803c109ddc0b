// Rician noise: its moments, the verdict on samples, and walls that stay where they are.
#include <cmath>

#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/build/build_model.h"
#include "modeling/network/tessellation.h"
#include "recovery/fit/fit_model.h"
#include "recovery/phantoms/phantom.h"
#include "recovery/wall/rician_noise.h"

namespace angiospline {
namespace {

std::vector<double> magnitudes(double amplitude, double sigma, int count, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> values;
  for (int k = 0; k < count; ++k) {
    const double real = amplitude + sigma * random.gaussian();
    values.push_back(std::hypot(real, sigma * random.gaussian()));
  }
  return values;
}

std::vector<double> gaussians(double mean, double sigma, int count, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> values;
  for (int k = 0; k < count; ++k) values.push_back(mean + sigma * random.gaussian());
  return values;
}

TEST(RicianNoise, HasTheMomentsOfItsDensity) {
  for (const double a : {0.0, 0.5, 1.0, 3.0, 8.0, 11.9, 12.1, 40.0}) {
    // Of the density x exp(-(x - a)^2 / 2) exp(-x a) I0(x a), by the rectangle rule.
    double mass = 0, first = 0, second = 0;
    const double step = 1e-3;
    for (double x = std::max(0.0, a - 9) + step / 2; x < a + 9; x += step) {
      const double z = x * a;
      const double bessel = z < 500 ? std::exp(-z) * std::cyl_bessel_i(0, z)
                                    : (1 + 1 / (8 * z)) / std::sqrt(2 * std::acos(-1.0) * z);
      const double p = x * std::exp(-(x - a) * (x - a) / 2) * bessel * step;
      mass += p, first += x * p, second += x * x * p;
    }
    EXPECT_NEAR(mass, 1, 1e-5) << a;
    const double sigma = 2.5;
    EXPECT_NEAR(rician_mean(a * sigma, sigma), sigma * first, 1e-4 * sigma * first) << a;
    EXPECT_NEAR(rician_deviation(a * sigma, sigma), sigma * std::sqrt(second - first * first),
                1e-3 * sigma)
        << a;
    if (a > 0) {
      EXPECT_NEAR(rician_amplitude(rician_mean(a * sigma, sigma), sigma), a * sigma, 1e-6 * sigma);
    }
  }
  EXPECT_EQ(rician_amplitude(1.0, 1.0), 0.0);  // below what no signal gives
}

TEST(RicianNoise, IsToldFromWhiteNoiseAndItsSigmaFound) {
  for (const double background : {0.0, 0.8, 1.6}) {
    const NoiseVerdict verdict =
        noise_of(magnitudes(6 * 30, 30, 1500, 1), magnitudes(background * 30, 30, 3000, 2));
    EXPECT_EQ(verdict.kind, NoiseKind::kRician) << background;
    EXPECT_NEAR(verdict.sigma, 30, 1.0) << background;
  }
  const std::vector<double> inside = gaussians(200, 30, 1500, 1);
  for (const double background : {20.0, 60.0, 120.0}) {
    std::vector<double> outside = gaussians(background, 30, 3000, 2);
    EXPECT_EQ(noise_of(inside, outside).kind, NoiseKind::kWhite) << background;
    for (double& v : outside) v = std::max(0.0, v);  // stored without a sign
    const NoiseVerdict clipped = noise_of(inside, outside);
    EXPECT_EQ(clipped.kind, NoiseKind::kWhite) << background;
  }
  // A quieter background is not yet a Rician one.
  EXPECT_EQ(noise_of(inside, gaussians(120, 20, 3000, 3)).kind, NoiseKind::kWhite);
  EXPECT_EQ(noise_of(magnitudes(180, 30, 49, 1), magnitudes(0, 30, 3000, 2)).kind,
            NoiseKind::kWhite);
}

// Mean signed distance of the wall from the cylinder, away from its ends.
double bias_on_cylinder(const Image<float>& image, const CenterlineTree& tree, FitReport& report) {
  const auto fitted = fit_model(*build_model(tree), image);
  EXPECT_TRUE(fitted);
  report = fitted->report;
  const Vec3 a = tree.branches[0].points_mm.col(0), b = tree.branches[0].points_mm.rightCols(1);
  const Vec3 axis = (b - a).normalized();
  const auto mesh = tessellate(fitted->model.network);
  double sum = 0, count = 0;
  for (Eigen::Index k = 0; k < mesh->mesh.points_mm.cols(); ++k) {
    const Vec3 d = mesh->mesh.points_mm.col(k) - a;
    const double along = axis.dot(d), away = (d - along * axis).norm();
    if (along < 3 || along > (b - a).norm() - 3 || away < 5) continue;
    sum += away - tree.branches[0].radii_mm(0);
    count += 1;
  }
  return sum / count;
}

TEST(FitModel, IsNotBiasedByRicianNoise) {
  PhantomOptions options;
  options.background = 200;
  options.vessel = 1200;
  const auto phantom = make_phantom(PhantomKind::kCylinder, options);
  double white = 0, rician = 0;
  const int repeats = 3;
  for (int seed = 0; seed < repeats; ++seed) {
    Random random(static_cast<std::uint64_t>(seed) + 11);
    Image<float> one(phantom->image.grid), other = one;
    for (std::size_t i = 0; i < one.voxels.size(); ++i) {
      const double real = phantom->image.voxels[i] + 250 * random.gaussian();
      one.voxels[i] = static_cast<float>(real);
      other.voxels[i] = static_cast<float>(std::hypot(real, 250 * random.gaussian()));
    }
    FitReport report;
    white += bias_on_cylinder(one, phantom->tree, report) / repeats;
    EXPECT_EQ(report.noise_kind, NoiseKind::kWhite);
    rician += bias_on_cylinder(other, phantom->tree, report) / repeats;
    EXPECT_EQ(report.noise_kind, NoiseKind::kRician);
    EXPECT_NEAR(report.noise, 250, 12);
  }
  EXPECT_NEAR(rician, white, 0.02);  // without the correction -0.04 apart
}

}  // namespace
}  // namespace angiospline
