// The default fit: profile sums on analytic walls, then whole models on phantoms.
#include <atomic>
#include <cmath>

#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "recovery/capture/axes.h"
#include "recovery/capture/capture.h"
#include "recovery/fit/fit_model.h"
#include "recovery/fit/reduction.h"
#include "recovery/fit/rings.h"
#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {
namespace {

ImageGrid cube(int n) {
  ImageGrid grid;
  grid.size = {n, n, n};
  return grid;
}

Image<float> grey_of(const Phantom& phantom) {
  Image<float> grey(phantom.image.grid);
  for (std::size_t i = 0; i < grey.voxels.size(); ++i) grey.voxels[i] = phantom.image.voxels[i];
  return grey;
}

// Signed distance to the tubes of a tree, negative inside.
double distance_to(const CenterlineTree& tree, const Vec3& p) {
  double least = 1e300;
  for (const CenterlineBranch& b : tree.branches) {
    for (Eigen::Index k = 0; k + 1 < b.points_mm.cols(); ++k) {
      const Vec3 a = b.points_mm.col(k), d = b.points_mm.col(k + 1) - a;
      const double t = std::clamp(d.dot(p - a) / d.squaredNorm(), 0.0, 1.0);
      least = std::min(least,
                       (p - a - t * d).norm() - ((1 - t) * b.radii_mm(k) + t * b.radii_mm(k + 1)));
    }
  }
  return least;
}

// Mean distance of the wall from the tree's tubes, away from open ends.
double mean_distance(const SurfaceNetwork& network, const CenterlineTree& truth) {
  double sum = 0, count = 0;
  for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
    const BSplineSurface<3> surface = patch_surface(network, p);
    for (int i = 0; i <= 20; ++i) {
      for (int j = 0; j < 8; ++j) {
        const double u = surface.u().first() + (surface.u().last() - surface.u().first()) * i / 20;
        const Vec3 x = surface.at(u, j / 8.0);
        bool near_end = false;
        for (const Rim& rim : network.rims) {
          near_end = near_end || std::abs((x - rim.center_mm).dot(rim.normal)) < 2;
        }
        if (near_end) continue;
        sum += std::abs(distance_to(truth, x));
        count += 1;
      }
    }
  }
  return sum / count;
}

TEST(GreyField, ReproducesQuadraticsBetweenVoxelCentres) {
  Image<float> image(cube(12));
  image.grid.spacing_mm = Vec3(1, 0.5, 2);
  image.grid.origin_mm = Vec3(-3, 5, 7);
  image.grid.direction << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  const auto quadratic = [](const Vec3& p) {
    return 3 + p.x() - p.y() * p.z() / 4 + p.y() * p.y();
  };
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    image.voxels[i] = static_cast<float>(quadratic(image.grid.world_mm(image.grid.voxel(i))));
  }
  const GreyField field(image);
  for (const Vec3& index : {Vec3(3.3, 4.7, 5.1), Vec3(6.5, 2.25, 8.9)}) {
    const Vec3 p = image.grid.world_mm(index);
    EXPECT_TRUE(field.covers(p));
    EXPECT_NEAR(field.at(p), quadratic(p), 2e-4);
  }
  EXPECT_FALSE(field.covers(image.grid.world_mm(Vec3(-0.6, 4, 4))));
  EXPECT_NEAR(field.width_mm(image.grid.direction.col(2)), 2.0, 1e-12);
}

TEST(WallProfile, FindsCurvedWallsWithoutTheBiasOfEdgeDetectors) {
  // A sphere, partial volumes. An edge detector puts it 1.2 / R voxels inside.
  for (const double radius : {2.5, 5.0, 10.0}) {
    const Vec3 center(15.3, 15.6, 15.1);
    const Image<float> image = coverage(cube(32), {round_cone(center, radius, center, radius)});
    const GreyField field(image);
    double sum = 0;
    int count = 0;
    for (int i = 0; i < 200; ++i) {
      const double z = -1 + 2 * (i + 0.5) / 200, a = 2.399963 * i, s = std::sqrt(1 - z * z);
      const Vec3 n(s * std::cos(a), s * std::sin(a), z);
      for (const double start : {-0.3, 0.0, 0.3}) {  // from beside the wall
        const double r = radius + start;
        const WallOffset offset =
            wall_offset(field, {center + r * n, n, 1 / r, 1 / r}, {1.0, 0.0}, {1.25, 0.0});
        ASSERT_TRUE(offset.measured);
        if (start == 0) sum += offset.offset_mm, ++count;
        EXPECT_NEAR(offset.offset_mm, -start, 0.25);
      }
    }
    EXPECT_NEAR(sum / count, 0.0, 0.02) << "radius " << radius;
  }
}

TEST(WallProfile, StopsAtANeighbour) {
  // Two slabs, three voxels apart: the profile of one must not see the other.
  Image<float> one(cube(24)), two(cube(24));
  for (std::size_t i = 0; i < one.voxels.size(); ++i) {
    const int x = one.grid.voxel(i)[0];
    one.voxels[i] = x <= 10 ? 1.0F : 0.0F;
    two.voxels[i] = x <= 10 || x >= 13 ? 1.0F : 0.0F;
  }
  const WallPoint wall{Vec3(10.5, 12, 12), Vec3::UnitX(), 0, 0};
  const GreyField lone(one), pair(two);
  const double alone = wall_offset(lone, wall, {1, 0}, {2.5, 0}).offset_mm;
  const double beside = wall_offset(pair, wall, {1, 0}, {2.5, 0}).offset_mm;
  EXPECT_NEAR(alone, 0.0, 0.02);
  EXPECT_NEAR(beside, 0.0, 0.12);
}

TEST(FitRings, FinerBodiesAreTheSameSurfaces) {
  const auto phantom = make_phantom(PhantomKind::kBifurcation);
  const auto model = build_model(phantom->tree);
  const SurfaceNetwork finer = with_finer_bodies(model->network, 0.5);
  ASSERT_FALSE(find_defect(finer));
  ASSERT_GT(finer.control_points_mm.cols(), model->network.control_points_mm.cols());
  for (int p = 0; p < static_cast<int>(finer.patches.size()); ++p) {
    const auto a = patch_surface(model->network, p), b = patch_surface(finer, p);
    for (const double u : {0.0, 0.37, 1.0}) {
      EXPECT_LT((a.at(u, 0.4) - b.at(u, 0.4)).norm(), 1e-10);
    }
  }
  EXPECT_LT(certify(finer)->max_normal_angle_deg, 1e-6);
}

TEST(FitRings, FewerKnotsKeepEndsTangentPlanesAndTheToleranceGiven) {
  const auto phantom = make_phantom(PhantomKind::kBifurcation);
  const auto model = build_model(phantom->tree);
  const SurfaceNetwork fine = with_finer_bodies(model->network, 0.3);
  const double tolerance = 0.02;
  const SurfaceNetwork fewer = with_fewer_knots(fine, tolerance);
  ASSERT_FALSE(find_defect(fewer));
  EXPECT_LT(fewer.control_points_mm.cols(), fine.control_points_mm.cols() * 3 / 4);
  double farthest = 0;
  for (int p = 0; p < static_cast<int>(fine.patches.size()); ++p) {
    const auto a = patch_surface(fine, p), b = patch_surface(fewer, p);
    for (int i = 0; i <= 40; ++i) {
      const double u = a.u().first() + (a.u().last() - a.u().first()) * i / 40;
      for (const double v : {0.0, 0.3, 0.9}) {
        farthest = std::max(farthest, (a.at(u, v) - b.at(u, v)).norm());
      }
    }
  }
  EXPECT_LE(farthest, tolerance);
  EXPECT_LT(certify(fewer)->max_normal_angle_deg, 1e-6);
}

TEST(FitAxes, LeaveArcsAndStraightenNoise) {
  // A path of constant third derivative zero (a parabola) and the same with noise.
  const int n = 40;
  AxisSections exact{Points3(3, n), Eigen::VectorXd(n), std::vector<char>(n, 1), 2.0};
  Random random(5);
  for (int k = 0; k < n; ++k) {
    exact.along_mm(k) = 1.5 * k;
    exact.centers_mm.col(k) = Vec3(1.4 * k, 0.01 * k * k, 3 + 0.3 * k);
  }
  AxisSections noisy = exact;
  for (double& x : noisy.centers_mm.reshaped()) x += 0.2 * random.gaussian();
  noisy.measured[20] = 0;  // far off, and known to be
  noisy.centers_mm.col(20).array() += 5;
  AxisSections few = noisy;
  std::fill(few.measured.begin() + 7, few.measured.end(), char{0});
  const auto smooth = smooth_axes({exact, noisy, few});
  ASSERT_EQ(smooth.size(), 3U);
  EXPECT_LT((smooth[0] - exact.centers_mm).cwiseAbs().maxCoeff(), 1e-3);
  const auto rms = [&](const Points3& p) {
    return std::sqrt((p - exact.centers_mm).squaredNorm() / (3.0 * n));
  };
  EXPECT_LT(rms(smooth[1]), 0.5 * 0.2);
  EXPECT_LT((smooth[1].col(20) - exact.centers_mm.col(20)).norm(), 0.3);
  EXPECT_EQ(smooth[2], few.centers_mm);  // too few to tell noise from shape
}

TEST(FitModel, PutsANoisyCylinderOnItsWall) {
  PhantomOptions options;
  options.snr = 4;
  const auto phantom = make_phantom(PhantomKind::kCylinder, options);
  const Image<float> image = grey_of(*phantom);
  const auto fitted = fit_model(*build_model(phantom->tree), image);
  ASSERT_TRUE(fitted);
  EXPECT_LT(mean_distance(fitted->model.network, phantom->tree), 0.04);
  EXPECT_NEAR(fitted->report.snr, 4, 0.4);
  EXPECT_TRUE(fitted->report.held.empty());
  const auto certificate = certify(fitted->model.network);
  EXPECT_TRUE(certificate->closed && certificate->valid);
  EXPECT_LT(certificate->max_normal_angle_deg, 0.01);
}

TEST(FitModel, MovesJunctionsAndBodiesTogetherAndKeepsThemSmooth) {
  PhantomOptions options;
  options.snr = 8;
  options.spacing_mm = Vec3::Constant(2);  // radii of 7, 5.5 and 4.5 voxels
  const auto phantom = make_phantom(PhantomKind::kBifurcation, options);
  const Image<float> image = grey_of(*phantom);
  CenterlineTree start = phantom->tree;  // beside the truth by a voxel, and too thin
  for (CenterlineNode& node : start.nodes) node.position_mm += Vec3(1.2, 1.2, 0);
  for (CenterlineBranch& branch : start.branches) {
    branch.points_mm.colwise() += Vec3(1.2, 1.2, 0);
    branch.radii_mm *= 0.85;
  }
  const auto seed = build_model(start);
  const auto fitted = fit_model(*seed, image);
  ASSERT_TRUE(fitted);
  EXPECT_GT(mean_distance(seed->network, phantom->tree), 1.0);
  EXPECT_LT(mean_distance(fitted->model.network, phantom->tree), 0.07 * 2);
  const auto certificate = certify(fitted->model.network);
  EXPECT_TRUE(certificate->closed && certificate->valid && !certificate->self_intersecting);
  EXPECT_LT(certificate->max_normal_angle_deg, 0.01);
  for (const Rim& rim : fitted->model.network.rims) {
    for (const Side& side : rim.sides) {  // ends stay plane
      const auto surface = patch_surface(fitted->model.network, side.patch);
      const Vec2 uv = side_parameters(
          fitted->model.network.patches[static_cast<std::size_t>(side.patch)], side.side, 0.3);
      EXPECT_NEAR((surface.at(uv.x(), uv.y()) - rim.center_mm).dot(rim.normal), 0.0, 1e-9);
    }
  }
}

TEST(FitModel, FindsTheWallFromAStartWhollyInsideTheVessel) {
  PhantomOptions options;
  options.snr = 4;
  const auto phantom = make_phantom(PhantomKind::kCylinder, options);
  CenterlineTree start = phantom->tree;
  for (CenterlineBranch& branch : start.branches) branch.radii_mm *= 0.5;
  const auto fitted = fit_model(*build_model(start), grey_of(*phantom));
  ASSERT_TRUE(fitted) << fitted.error().message();
  EXPECT_EQ(fitted->report.recaptured.size(), 1U);
  EXPECT_LT(mean_distance(fitted->model.network, phantom->tree), 0.15);
}

TEST(FitModel, ShowsItsProgressAndStopsWhenAsked) {
  PhantomOptions options;
  options.snr = 8;
  const auto phantom = make_phantom(PhantomKind::kBentVessel, options);
  const Image<float> image = grey_of(*phantom);
  const auto seed = build_model(phantom->tree);
  std::atomic<int> reports{0};
  Progress progress;
  progress.report = [&](std::string_view, double fraction) {
    EXPECT_TRUE(fraction >= 0 && fraction <= 1);
    ++reports;
  };
  ASSERT_TRUE(fit_model(*seed, image, {}, progress));
  const int all = reports;
  EXPECT_GT(all, 5);
  for (const int stop_at : {0, all / 3, 2 * all / 3}) {
    reports = 0;
    progress.stop_requested = [&] { return reports >= stop_at; };
    const auto stopped = fit_model(*seed, image, {}, progress);
    ASSERT_FALSE(stopped) << stop_at;
    EXPECT_EQ(stopped.error().kind, ErrorKind::kCancelled);
    EXPECT_LT(reports, all);
  }
}

TEST(FitModel, IsRepeatable) {
  PhantomOptions options;
  options.snr = 3;
  const auto phantom = make_phantom(PhantomKind::kBentVessel, options);
  const Image<float> image = grey_of(*phantom);
  const auto seed = build_model(phantom->tree);
  const auto one = fit_model(*seed, image);
  const auto two = fit_model(*seed, image);
  EXPECT_EQ(one->model.network.control_points_mm, two->model.network.control_points_mm);
}

TEST(FitModel, NamesWhatIsWrong) {
  const auto phantom = make_phantom(PhantomKind::kBentVessel);
  const auto seed = build_model(phantom->tree);
  Image<float> image = grey_of(*phantom);
  image.grid.origin_mm = Vec3(500, 0, 0);
  auto apart = fit_model(*seed, image);
  ASSERT_FALSE(apart);
  EXPECT_NE(apart.error().message().find("outside the image"), std::string::npos);

  image.grid.origin_mm = Vec3::Zero();
  image.voxels[7] = std::numeric_limits<float>::quiet_NaN();
  auto with_nan = grey_image(AnyImage(image), "image.nrrd");
  ASSERT_FALSE(with_nan);
  EXPECT_NE(with_nan.error().message().find("image.nrrd, voxel (7, 0, 0)"), std::string::npos);

  auto constant = grey_image(AnyImage(Image<float>(image.grid, 3.0F)), "flat.nrrd");
  ASSERT_FALSE(constant);
  EXPECT_NE(constant.error().message().find("flat.nrrd: the image is constant"), std::string::npos);
}

TEST(FitModel, LeavesABranchWithoutAnyEdgeAndSaysWhich) {
  // The second tube of the model is not in the image.
  const auto phantom = make_phantom(PhantomKind::kBentVessel);
  CenterlineTree tree = phantom->tree;
  tree.nodes.push_back({"a", Vec3(4, 27, 10)});
  tree.nodes.push_back({"b", Vec3(4, 27, 40)});
  CenterlineBranch extra;
  extra.name = "ghost";
  extra.from = 2;
  extra.to = 3;
  extra.points_mm.resize(3, 2);
  extra.points_mm << 4, 4, 27, 27, 10, 40;
  extra.radii_mm = Eigen::Vector2d(2, 2);
  tree.branches.push_back(extra);
  const Image<float> image = grey_of(*phantom);
  const auto fitted = fit_model(*build_model(tree), image);
  ASSERT_TRUE(fitted);
  ASSERT_EQ(fitted->report.without_edge.size(), 1U);
  EXPECT_EQ(fitted->report.without_edge.front(), "wall_ghost");
  EXPECT_LT(mean_distance(fitted->model.network, tree), 0.05);
}

}  // namespace
}  // namespace angiospline
