// Voxelisation against analytic volumes, shifted grids and degenerate positions.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "modeling/build/build_model.h"
#include "modeling/network/tessellation.h"
#include "recovery/analysis/compare_masks.h"
#include "recovery/imaging/rasterize/voxelize.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {
namespace {

// A box of two triangles a side, wound outward.
TriangleMesh box(const Vec3& low, const Vec3& high) {
  TriangleMesh mesh;
  mesh.points_mm.resize(3, 8);
  for (int k = 0; k < 8; ++k) {
    for (int d = 0; d < 3; ++d) mesh.points_mm(d, k) = (k >> d & 1) != 0 ? high(d) : low(d);
  }
  mesh.triangles.resize(3, 12);
  mesh.triangles << 0, 0, 1, 1, 0, 0, 2, 2, 0, 0, 4, 4,  //
      4, 6, 3, 7, 1, 5, 6, 7, 2, 3, 5, 7,                //
      6, 2, 7, 5, 5, 4, 7, 3, 3, 1, 7, 6;
  mesh.part_of.assign(12, 0);
  mesh.parts = {{"box", PartKind::kBody, 0}};
  return mesh;
}

double total(const Image<float>& share) {
  double sum = 0;
  for (const float v : share.voxels) sum += static_cast<double>(v);
  return sum;
}

ImageGrid grid_of_size(int n) {
  ImageGrid grid;
  grid.size = {n, n, n};
  return grid;
}

TEST(FilledShare, IsExactForBoxesOnLines) {
  const TriangleMesh mesh = box(Vec3(1.25, 2, 3.5), Vec3(5.75, 6, 7.5));
  ASSERT_TRUE(measure(mesh).closed());
  const Image<float> share = filled_share(mesh, grid_of_size(10), 4);
  EXPECT_NEAR(total(share), 4.5 * 4 * 4, 1e-4);
  EXPECT_NEAR((share[{3, 4, 5}]), 1.0, 1e-6);
  EXPECT_NEAR((share[{1, 4, 5}]), 0.25, 1e-6);  // from 1.25 to the voxel's far side at 1.5
  EXPECT_NEAR((share[{3, 2, 5}]), 0.5, 1e-6);   // y from 2, the voxel's middle
  EXPECT_EQ((share[{0, 4, 5}]), 0.0F);
}

TEST(FilledShare, CountsLinesThroughEdgesAndPointsOnce) {
  // One line a voxel: it runs through the box's edges and diagonals exactly.
  const TriangleMesh mesh = box(Vec3(2, 2, 2), Vec3(6, 6, 6));
  const Image<float> share = filled_share(mesh, grid_of_size(10), 1);
  EXPECT_NEAR(total(share), 64, 1e-4);  // half open: 4 x 4 lines of length 4
}

TEST(FilledShare, TurnsWithTheGrid) {
  const TriangleMesh mesh = box(Vec3(-3, 1, 2), Vec3(2, 4, 8));
  ImageGrid grid = grid_of_size(24);
  grid.spacing_mm = Vec3(0.5, 0.7, 0.9);
  grid.origin_mm = Vec3(7, -6, -6);
  grid.direction << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  EXPECT_NEAR(total(filled_share(mesh, grid, 16)) * grid.spacing_mm.prod(), 90, 1.5);
}

TEST(Voxelized, GivesATubeModelTheVolumeAndVoxelsOfItsPhantom) {
  const auto phantom = make_phantom(PhantomKind::kCylinder);
  const auto model = build_model(phantom->tree);
  const auto mesh = tessellate(model->network, {0.001, 1e9, 0.5});
  const Image<float> share = filled_share(mesh->mesh, phantom->truth.grid);
  EXPECT_NEAR(total(share), measure(mesh->mesh).volume_mm3, 15);
  const auto same = compare_masks(phantom->truth, voxelized(mesh->mesh, phantom->truth.grid));
  EXPECT_LT(same->missed_percent, 0.2);
  EXPECT_GT(same->dice, 0.999);
}

}  // namespace
}  // namespace angiospline
