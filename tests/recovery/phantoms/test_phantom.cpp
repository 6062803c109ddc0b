#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;

Phantom made(PhantomKind kind, const PhantomOptions& options = {}) {
  auto p = make_phantom(kind, options);
  EXPECT_TRUE(p.has_value()) << p.error().message();
  return *p;
}

double volume_of(const Image<float>& filled) {
  double sum = 0;
  for (const float f : filled.voxels) sum += static_cast<double>(f);
  return sum * filled.grid.spacing_mm.prod();
}

TEST(Coverage, GivesTheVolumesOfSolids) {
  ImageGrid grid;
  grid.size = {64, 64, 64};
  const Vec3 c(31.2, 30.7, 31.9), axis = Vec3(1, 2, -2).normalized();
  const auto volume = [&](const Shape& s) { return volume_of(coverage(grid, {s})); };
  EXPECT_NEAR(volume(torus(c, axis, 18, 5)) / (2 * kPi * kPi * 18 * 25), 1, 3e-3);
  EXPECT_NEAR(volume(flat_cylinder(c - 15 * axis, c + 15 * axis, 7)) / (kPi * 49 * 30), 1, 3e-3);
  EXPECT_NEAR(volume(round_cone(c, 9, c, 9)) / (4.0 / 3 * kPi * 729), 1, 3e-3);
  EXPECT_NEAR(volume(round_cone(c, 6, c + 14 * axis, 6)) / (4.0 / 3 * kPi * 216 + kPi * 36 * 14), 1,
              3e-3);
  // A ball inside the other's ball adds nothing.
  EXPECT_NEAR(volume(round_cone(c, 9, c + 2 * axis, 3)) / (4.0 / 3 * kPi * 729), 1, 3e-3);
}

TEST(Coverage, CountsAUnionOnceAndHonoursSpacing) {
  ImageGrid grid;
  grid.size = {40, 40, 14};
  grid.spacing_mm = Vec3(1, 1, 3);
  const Vec3 c(20, 20, 20);
  const Shape ball = round_cone(c, 9, c, 9);
  const Image<float> twice = coverage(grid, {ball, ball});
  EXPECT_EQ(twice.voxels, coverage(grid, {ball}).voxels);
  EXPECT_NEAR(volume_of(twice) / (4.0 / 3 * kPi * 729), 1, 5e-3);
}

TEST(RoundCone, IsADistanceWithSlopeOne) {
  const Shape s = round_cone(Vec3(0, 0, 0), 4, Vec3(10, 3, 1), 2);
  for (int k = 0; k < 200; ++k) {
    const Vec3 p(15 * std::sin(1.3 * k), 9 * std::cos(0.7 * k), 8 * std::sin(2.1 * k + 1));
    Vec3 slope;
    for (int i = 0; i < 3; ++i)
      slope[i] = (s.inside(p + 1e-5 * Vec3::Unit(i)) - s.inside(p - 1e-5 * Vec3::Unit(i))) / 2e-5;
    EXPECT_NEAR(slope.norm(), 1, 1e-5) << p.transpose();
    // The nearest surface point lies that far along the slope.
    EXPECT_NEAR(s.inside(p - s.inside(p) * slope), 0, 1e-4) << p.transpose();
  }
}

TEST(Phantom, HasTheSizesOfTheThesis) {
  EXPECT_EQ(made(PhantomKind::kRings).image.grid.size, (Voxel{128, 128, 128}));
  EXPECT_EQ(made(PhantomKind::kPotato).image.grid.size, (Voxel{64, 64, 64}));
  EXPECT_EQ(made(PhantomKind::kBifurcation).image.grid.size, (Voxel{128, 128, 128}));
  EXPECT_EQ(made(PhantomKind::kBentVessel).image.grid.size, (Voxel{32, 32, 48}));
  const Phantom cylinder = made(PhantomKind::kCylinder);
  EXPECT_EQ(cylinder.image.grid.size, (Voxel{64, 64, 64}));
  EXPECT_NEAR(static_cast<double>(voxel_count(cylinder.truth)), 15828, 150);  // the thesis's truth
}

TEST(Phantom, RingsAreLinkedAndApart) {
  const Phantom p = made(PhantomKind::kRings);
  EXPECT_EQ(component_count(p.truth, Neighbours::kCorners26), 3U);
  EXPECT_EQ(cycle_count(p.tree), 3);
  const std::vector<Ring> rings = phantom_rings();
  // Linked: a ring meets the flat disc of another exactly once.
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b) {
      if (a == b) continue;
      int crossings = 0;
      const Ring &r = rings[a], &disc = rings[b];
      const auto at = [&](int k) { return r.at(2 * kPi * (k + 0.5) / 720); };
      for (int k = 0; k < 720; ++k) {
        const double h0 = disc.axis.dot(at(k) - disc.centre_mm);
        const double h1 = disc.axis.dot(at(k + 1) - disc.centre_mm);
        if (h0 * h1 < 0 && (at(k) - disc.centre_mm).norm() < disc.ring_radius_mm) ++crossings;
      }
      EXPECT_EQ(crossings, 1);
    }
}

TEST(Phantom, TruthLiesAroundItsCenterlines) {
  for (const PhantomKind kind :
       {PhantomKind::kRings, PhantomKind::kCylinder, PhantomKind::kBifurcation,
        PhantomKind::kBentVessel, PhantomKind::kRandomTree}) {
    PhantomOptions o;
    o.spacing_mm = Vec3(1, 1, 1.5);
    o.direction << 0, 0, -1, 1, 0, 0, 0, -1, 0;
    o.origin_mm = Vec3(3, 4, 5);
    o.field_mm = 128;
    o.ends = 4;
    const Phantom p = made(kind, o);
    std::size_t points = 0;
    for (const CenterlineBranch& b : p.tree.branches)
      for (Eigen::Index k = 1; k + 1 < b.points_mm.cols(); ++k, ++points) {
        const Vec3 index = p.truth.grid.index_vox(b.points_mm.col(k));
        const Voxel v{static_cast<int>(std::lround(index[0])),
                      static_cast<int>(std::lround(index[1])),
                      static_cast<int>(std::lround(index[2]))};
        ASSERT_TRUE(p.truth.grid.contains(v));
        EXPECT_EQ(p.truth[v], 1);
      }
    EXPECT_TRUE(points > 0 || kind == PhantomKind::kBifurcation);
    for (const CenterlineBranch& b : p.tree.branches) {
      EXPECT_EQ(b.points_mm.col(0), p.tree.nodes[static_cast<std::size_t>(b.from)].position_mm);
      EXPECT_EQ(b.points_mm.rightCols<1>(),
                p.tree.nodes[static_cast<std::size_t>(b.to)].position_mm);
    }
  }
}

TEST(Phantom, NoiseHasTheStatedStrengthAndRepeats) {
  PhantomOptions o;
  o.snr = 4;
  o.seed = 7;
  const Phantom a = made(PhantomKind::kCylinder, o);
  double sum = 0, squares = 0, count = 0;
  for (int z = 0; z < 64; ++z)
    for (int y = 0; y < 64; ++y)
      for (int x = 0; x < 8; ++x) {
        const double g = (a.image[{x, y, z}]);
        ++count, sum += g, squares += g * g;
      }
  const double mean = sum / count;
  EXPECT_NEAR(mean, o.background, 5);
  EXPECT_NEAR(std::sqrt(squares / count - mean * mean), (o.vessel - o.background) / 4, 5);
  EXPECT_EQ(made(PhantomKind::kCylinder, o).image.voxels, a.image.voxels);
  o.seed = 8;
  EXPECT_NE(made(PhantomKind::kCylinder, o).image.voxels, a.image.voxels);
}

TEST(Phantom, LosesSignalEveryFortyFiveDegrees) {
  PhantomOptions o;
  o.loss_deg = 12;
  o.loss_phase_deg = 22.5;
  const Phantom p = made(PhantomKind::kRings, o);
  for (const Ring& r : phantom_rings())
    for (int k = 0; k < 16; ++k) {
      const Vec3 at = r.at(kPi * k / 8);
      const Voxel v{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                    static_cast<int>(std::lround(at[2]))};
      EXPECT_EQ(p.image[v], k % 2 ? 200 : 1200) << k;
      EXPECT_EQ(p.truth[v], 1);
    }
}

TEST(Phantom, RandomTreeIsATreeWithRoomAroundIt) {
  PhantomOptions o;
  o.field_mm = 128;
  o.radius_max_mm = 4;
  o.ends = 8;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    o.seed = seed;
    const Phantom p = made(PhantomKind::kRandomTree, o);
    EXPECT_EQ(p.tree.branches.size(), 15U);
    EXPECT_EQ(p.tree.nodes.size(), 16U);
    EXPECT_EQ(cycle_count(p.tree), 0);
    EXPECT_EQ(component_count(p.truth, Neighbours::kCorners26), 1U);
    EXPECT_EQ(fill_cavities(p.truth).regions, 0U);
  }
}

TEST(Phantom, SaysWhatIsWrongWithItsOptions) {
  PhantomOptions o;
  o.snr = 0;
  EXPECT_FALSE(make_phantom(PhantomKind::kRings, o).has_value());
  o = {};
  o.spacing_mm = Vec3(1, 0, 1);
  EXPECT_FALSE(make_phantom(PhantomKind::kRings, o).has_value());
  o = {};
  o.ends = 500;
  const auto crowded = make_phantom(PhantomKind::kRandomTree, o);
  ASSERT_FALSE(crowded.has_value());
  EXPECT_NE(crowded.error().message().find("of 500 ends placed"), std::string::npos);
  EXPECT_FALSE(phantom_kind("no such").has_value());
}

}  // namespace
}  // namespace angiospline
