#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/imaging/segment/seed_search.h"
#include "recovery/imaging/segment/segment.h"
#include "recovery/imaging/segment/vesselness.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {
namespace {

TEST(Vesselness, AnswersToTubesAndNotToSheetsOrBalls) {
  ImageGrid grid;
  grid.size = {41, 41, 41};
  Image<float> tube(grid), sheet(grid), ball(grid);
  for (std::size_t i = 0; i < tube.voxels.size(); ++i) {
    const Voxel v = grid.voxel(i);
    const double x = v[0] - 20, y = v[1] - 20, z = v[2] - 20;
    tube.voxels[i] = x * x + y * y <= 9 ? 100.0F : 0.0F;
    sheet.voxels[i] = std::abs(x) <= 3 ? 100.0F : 0.0F;
    ball.voxels[i] = x * x + y * y + z * z <= 9 ? 100.0F : 0.0F;
  }
  const auto middle = [](const Image<float>& image) {
    return vesselness(image)->answer[{20, 20, 20}];
  };
  EXPECT_GT(middle(tube), 3 * middle(sheet));
  EXPECT_GT(middle(tube), 3 * middle(ball));
  EXPECT_GT(middle(tube), 10);
  Image<float> negative = tube;
  for (float& v : negative.voxels) v = -v;
  EXPECT_EQ(middle(negative), 0);
}

TEST(Seeds, LieInTheVesselWhateverTheGrid) {
  for (const Vec3& spacing : {Vec3(1, 1, 1), Vec3(0.8, 0.8, 2)}) {
    PhantomOptions o;
    o.spacing_mm = spacing;
    o.snr = 6;
    o.origin_mm = Vec3(-50, 20, 7);
    o.direction << 0, 1, 0, -1, 0, 0, 0, 0, 1;
    const auto p = make_phantom(PhantomKind::kBifurcation, o);
    ASSERT_TRUE(p.has_value());
    const auto seeds = find_seeds(p->image);
    ASSERT_TRUE(seeds.has_value());
    ASSERT_FALSE(seeds->kept.empty());
    for (const TubularStructure& s : seeds->kept) {
      const Vec3 at = p->truth.grid.index_vox(s.core_mm);
      const Voxel v{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                    static_cast<int>(std::lround(at[2]))};
      EXPECT_EQ(p->truth[v], 1);
    }
  }
}

TEST(Seeds, AreNoneInAnImageOfOneGreyValue) {
  ImageGrid grid;
  grid.size = {20, 20, 20};
  const auto seeds = find_seeds(Image<float>(grid, 3.0F));
  ASSERT_TRUE(seeds.has_value());
  EXPECT_TRUE(seeds->kept.empty());
  const auto s = segment(Image<float>(grid, 3.0F));
  ASSERT_FALSE(s.has_value());
  EXPECT_EQ(s.error().what, "no vessel was found");
}

// An image to paint structures into; later ones lie over earlier ones.
struct Scene {
  Image<float> image{ImageGrid{{96, 96, 64}, Vec3::Ones(), Vec3::Zero(), Mat3::Identity()}};

  template <typename Inside>
  void paint(float grey, Inside&& inside) {
    for (std::size_t i = 0; i < image.voxels.size(); ++i) {
      const Voxel v = image.grid.voxel(i);
      if (inside(v[0], v[1], v[2])) image.voxels[i] = grey;
    }
  }
  void tube_along_z(int x, int y, double radius, float grey) {
    paint(grey, [=](int a, int b, int) { return std::hypot(a - x, b - y) <= radius; });
  }
  Image<float> with_noise(double deviation, std::uint64_t seed) const {
    Image<float> out = image;
    Random random(seed);
    for (float& v : out.voxels) v += static_cast<float>(deviation * random.gaussian());
    return out;
  }
};

// How many seeds lie within `reach` voxels of a tube along z.
int seeds_at(const SeedSearch& found, double x, double y, double reach = 2) {
  return static_cast<int>(
      std::count_if(found.kept.begin(), found.kept.end(), [&](const TubularStructure& s) {
        return std::hypot(s.core_mm.x() - x, s.core_mm.y() - y) <= reach;
      }));
}

bool says(const std::vector<std::string>& texts, const std::string& part) {
  return std::any_of(texts.begin(), texts.end(),
                     [&](const std::string& t) { return t.find(part) != std::string::npos; });
}

// Thin bright vessels among many longer and wider things that are darker.
TEST(Seeds, AreTheBrightestTubesWhateverElseIsTubularAndWhateverTheNoise) {
  Scene scene;
  for (const int y : {10, 24, 38, 52, 66, 80})
    for (const int x : {58, 78}) scene.tube_along_z(x, y, 4, 600);
  scene.paint(1000, [](int x, int y, int z) {
    return z > 20 && z < 44 && (std::hypot(x - 20, y - 20) <= 2 || std::hypot(x - 20, y - 70) <= 3);
  });
  for (std::uint64_t noise = 0; noise < 5; ++noise) {
    const auto found = find_seeds(scene.with_noise(60, noise));
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->kept.size(), 2U) << noise;
    EXPECT_EQ(seeds_at(*found, 20, 20), 1) << noise;
    EXPECT_EQ(seeds_at(*found, 20, 70), 1) << noise;
    EXPECT_TRUE(says(found->left_out, "12 structures are left out as far weaker")) << noise;
  }
  SeedSearchOptions all;
  all.least_strength = 0;
  EXPECT_EQ(find_seeds(scene.with_noise(60, 0), all)->kept.size(), 14U);
  all.most = 3;
  const auto three = find_seeds(scene.with_noise(60, 0), all);
  EXPECT_EQ(three->kept.size(), 3U);
  EXPECT_TRUE(says(three->left_out, "11 structures are left out as more than"));
}

TEST(Seeds, AreNotInSheetsBallsSpotsOrAlongTheBorderHoweverBright) {
  Scene scene;
  scene.tube_along_z(20, 20, 3, 1000);
  scene.paint(5000, [](int x, int y, int z) {
    const bool sheet = std::abs(x - 70) <= 2 && y > 20 && y < 76 && z > 12 && z < 52;
    const bool ball = std::hypot(x - 26, y - 66, z - 32) <= 5;
    const bool spot = x == 46 && y == 46 && z == 20;
    return sheet || ball || spot;
  });
  scene.paint(2500, [](int, int y, int z) { return std::hypot(y - 93, z - 32) <= 2; });
  const auto found = find_seeds(scene.with_noise(20, 1));
  ASSERT_TRUE(found.has_value());
  ASSERT_EQ(found->kept.size(), 1U);
  EXPECT_EQ(seeds_at(*found, 20, 20), 1);
  EXPECT_TRUE(says(found->left_out, "no tubes"));
  EXPECT_TRUE(says(found->left_out, "along the image's border"));
}

// A vessel that crosses the image from border to border is not one along the border.
TEST(Seeds, AreInAVesselThatCrossesTheBorder) {
  Scene scene;
  scene.tube_along_z(48, 48, 3, 1000);
  const auto found = find_seeds(scene.with_noise(50, 2));
  ASSERT_EQ(found->kept.size(), 1U);
  EXPECT_TRUE(found->left_out.empty());
  EXPECT_LT(found->kept[0].border_share, 0.2);
  EXPECT_GT(found->kept[0].length_radii, 10);
  EXPECT_GT(found->kept[0].tubeness, 0.5);
}

// Fewer than 16 slices are all near the border; that counts for nothing.
TEST(Seeds, AreFoundInAThinSlab) {
  Scene scene;
  scene.paint(1000, [](int, int y, int z) { return std::hypot(y - 40, z - 5) <= 2.5; });
  Image<float> slab(ImageGrid{{96, 96, 11}, Vec3::Ones(), Vec3::Zero(), Mat3::Identity()});
  for (std::size_t i = 0; i < slab.voxels.size(); ++i)
    slab.voxels[i] = scene.image[slab.grid.voxel(i)];
  EXPECT_EQ(find_seeds(slab)->kept.size(), 1U);
}

TEST(Segment, SaysWhatItLeavesOutAsSeeds) {
  Scene scene;
  scene.tube_along_z(30, 30, 4, 1000);
  scene.tube_along_z(70, 70, 4, 500);
  const auto s = segment(scene.with_noise(40, 3));
  ASSERT_TRUE(s.has_value()) << s.error().message();
  EXPECT_EQ(s->report.components, 1U);
  EXPECT_EQ((s->mask[{30, 30, 30}]), 1);
  EXPECT_TRUE(says(s->report.choices, "1 structure is left out as far weaker"));
  EXPECT_TRUE(says(s->report.choices, "at 70."));
}

}  // namespace
}  // namespace angiospline
