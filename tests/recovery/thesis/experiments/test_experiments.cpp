#include <cmath>
#include <numbers>
#include <numeric>

#include <gtest/gtest.h>

#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/imaging/rasterize/voxelize.h"
#include "recovery/thesis/deform/mesh.h"
#include "recovery/thesis/experiments/outline.h"
#include "recovery/thesis/experiments/printed_contours.h"
#include "recovery/thesis/experiments/reproduce.h"
#include "recovery/thesis/experiments/rules.h"
#include "recovery/thesis/experiments/slice.h"
#include "recovery/thesis/experiments/tables.h"

namespace angiospline {
namespace {

std::size_t voxels(const Mask& mask) {
  return std::accumulate(mask.voxels.begin(), mask.voxels.end(), std::size_t{0});
}

TEST(MaskInside, CountsTheVoxelsOfABoxAndOfADisc) {
  TriangleMesh box;  // from (1.5, 2.5, 3.5) to (6.5, 8.5, 4.5): 5 x 6 x 1 voxels
  box.points_mm.resize(3, 8);
  for (int k = 0; k < 8; ++k)
    box.points_mm.col(k) = Vec3(k & 1 ? 6.5 : 1.5, k & 2 ? 8.5 : 2.5, k & 4 ? 4.5 : 3.5);
  const int quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                           {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  box.triangles.resize(3, 12);
  for (int q = 0; q < 6; ++q) {
    box.triangles.col(2 * q) << quads[q][0], quads[q][1], quads[q][2];
    box.triangles.col(2 * q + 1) << quads[q][0], quads[q][2], quads[q][3];
  }
  ImageGrid grid;
  grid.size = {10, 12, 9};
  const Mask mask = mask_inside(box, grid);
  EXPECT_EQ(voxels(mask), 30U);
  EXPECT_EQ((mask[{2, 3, 4}]), 1);
  EXPECT_EQ((mask[{7, 3, 4}]), 0);
  // Half as wide voxels: eight times as many.
  ImageGrid fine = grid;
  fine.size = {20, 24, 18};
  fine.spacing_mm = Vec3::Constant(0.5);
  fine.origin_mm = Vec3::Constant(-0.25);
  EXPECT_EQ(voxels(mask_inside(box, fine)), 240U);

  ImageGrid flat;
  flat.size = {40, 40, 1};
  const DeformMesh disc = circle_contour({19.6, 20.3, 0}, 13, 200);
  EXPECT_NEAR(static_cast<double>(voxels(mask_inside(disc.nodes_mm, flat))), std::numbers::pi * 169,
              6);
}

TEST(MaskInside, AgreesWithCoverageOnARoundTube) {
  constexpr int kRows = 30, kColumns = 90;
  DeformMesh mesh;
  mesh.nodes_mm.resize(3, kRows * kColumns);
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c) {
      const double a = 2 * std::numbers::pi * c / kColumns;
      mesh.nodes_mm.col(r * kColumns + c) =
          Vec3(16.2 + 9 * std::cos(a), 15.7 + 9 * std::sin(a), 3.2 + 0.8 * r);
      if (r + 1 < kRows)
        mesh.faces.push_back({r * kColumns + c, r * kColumns + (c + 1) % kColumns,
                              (r + 1) * kColumns + (c + 1) % kColumns, (r + 1) * kColumns + c});
    }
  ImageGrid grid;
  grid.size = {32, 32, 32};
  const Mask mask = mask_inside(triangles_of(mesh, Caps::kFans), grid);
  const auto filled =
      coverage(grid, {flat_cylinder({16.2, 15.7, 3.2}, {16.2, 15.7, 3.2 + 0.8 * 29}, 9)});
  std::size_t differ = 0;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    differ += (mask.voxels[i] != 0) != (filled.voxels[i] >= 0.5F);
  EXPECT_GT(voxels(mask), 5000U);
  EXPECT_LT(differ, voxels(mask) / 100);
}

TEST(ArterySlice, HasArteriesAsLargeAsTheThesis) {
  const ArterySlice slice = artery_slice(8, 1);
  EXPECT_NEAR(static_cast<double>(voxels(slice.right.truth)), 122, 3);
  EXPECT_NEAR(static_cast<double>(voxels(slice.left.truth)), 158, 3);
  EXPECT_EQ(slice.image.voxels, artery_slice(8, 1).image.voxels);
  EXPECT_NE(slice.image.voxels, artery_slice(8, 2).image.voxels);
}

// Table 7.4 states means and a deviation over the rows that it does not star.
TEST(PrintedContours, HaveTheAveragesThatTheThesisPrints) {
  double iterations = 0, missed = 0, squares = 0;
  for (const std::size_t k : {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 12U, 13U, 14U}) {
    iterations += experiments::kStartPositions[k].printed.iterations / 12;
    missed += experiments::kStartPositions[k].printed.missed / 12;
    squares += std::pow(experiments::kStartPositions[k].printed.missed, 2) / 12;
  }
  EXPECT_NEAR(iterations, 55.8, 0.06);
  EXPECT_NEAR(missed, 20.8, 0.06);
  EXPECT_NEAR(std::sqrt(squares - missed * missed), 3.2, 0.2);
  double of_sizes = 0;
  for (const auto& s : experiments::kStartSizes) of_sizes += s.printed.missed / 8;
  EXPECT_NEAR(of_sizes, 18.6, 0.06);
  // The same circle stands in both halves of the table.
  EXPECT_EQ(experiments::kStartSizes[3].printed.missed,
            experiments::kStartPositions[0].printed.missed);
}

TEST(Reproduce, QuickContoursStopEarly) {
  ReproduceOptions quick;
  quick.quick = true;
  const auto table = reproduce_table("7.4", quick);
  ASSERT_TRUE(table) << table.error().message();
  ASSERT_EQ(table->rows.size(), 3U);
  for (const ReproducedRow& row : table->rows) {
    for (std::size_t c = 0; c < row.figures.size(); c += 2) {
      EXPECT_LE(*row.figures[c].ours, experiment_rules::kQuickContour);
      EXPECT_EQ(row.figures[c].thesis.has_value(), c == 0);
    }
  }
}

TEST(Listed, SeparatesFiguresByCommas) {
  EXPECT_EQ(experiments::listed({12, 15.26, 18}, 1), "12.0, 15.3, 18.0");
  EXPECT_EQ(experiments::listed({7}), "7");
  EXPECT_EQ(experiments::listed({}), "");
}

TEST(Reproduce, QuickTablesAreFilled) {
  ReproduceOptions quick;
  quick.quick = true;
  int figures = 0;
  for (const char* id : {"7.1", "7.2", "7.4", "7.5", "cylinder"}) {
    const auto table = reproduce_table(id, quick);
    ASSERT_TRUE(table) << table.error().message();
    EXPECT_EQ(table->id, id);
    EXPECT_FALSE(table->rows.empty());
    for (const ReproducedRow& row : table->rows) {
      EXPECT_EQ(row.figures.size(), table->columns.size()) << row.label;
      for (const ReproducedFigure& f : row.figures) {
        ASSERT_TRUE(f.ours);
        EXPECT_TRUE(std::isfinite(*f.ours));
        ++figures;
      }
    }
  }
  EXPECT_GT(figures, 60);
}

TEST(Reproduce, TableOfMethodsShowsTheThesisTrends) {
  const auto table = reproduce_table("7.5");
  ASSERT_TRUE(table);
  ASSERT_EQ(table->rows.size(), 11U);
  EXPECT_EQ(*table->rows[2].figures[1].thesis, 27);
  EXPECT_TRUE(table->trends.front().holds) << table->trends.front().ours;
}

TEST(Reproduce, UnknownTablesAreNamedWithTheKnownOnes) {
  const auto table = reproduce_table("8.1");
  ASSERT_FALSE(table);
  EXPECT_NE(table.error().message().find("8.1"), std::string::npos);
  for (const std::string& known : reproducible_tables()) {
    EXPECT_NE(table.error().message().find(known), std::string::npos) << known;
  }
}

}  // namespace
}  // namespace angiospline
