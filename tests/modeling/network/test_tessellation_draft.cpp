#include <cmath>
#include <numbers>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/network/rules.h"
#include "modeling/network/tessellation_draft.h"
#include "modeling/network/tessellation_edges.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

Vec3 twice_area(const TessellationDraft& draft, const std::array<int, 3>& t) {
  const auto at = [&](int k) {
    return draft.points[static_cast<std::size_t>(t[static_cast<std::size_t>(k)])];
  };
  return (at(1) - at(0)).cross(at(2) - at(0));
}

MeshChain random_chain(Random& random, double y, double length, TessellationDraft& draft) {
  MeshChain chain;
  double x = 0;
  while (x < length) {
    chain.push(x / length, draft.add_point({}, {x, y, 0}));
    x += random.uniform(0.05, 0.8);
  }
  chain.push(1, draft.add_point({}, {length, y, 0}));
  return chain;
}

TEST(ZipChains, CoverTheStripOnceWithoutTurningATriangleOver) {
  Random random(5);
  for (int trial = 0; trial < 100; ++trial) {
    TessellationDraft draft;
    const MeshChain outer = random_chain(random, 0, 3, draft);
    const MeshChain inner = random_chain(random, 0.5, 3, draft);
    draft.add_strip(outer, inner, 7);
    double sum = 0;
    for (const auto& t : draft.triangles) {
      const Vec3 area = twice_area(draft, t);
      EXPECT_GT(area.z(), 0);
      sum += area.z() / 2;
    }
    EXPECT_NEAR(sum, 1.5, 1e-12);
    EXPECT_EQ(draft.triangles.size(), outer.points.size() + inner.points.size() - 2);
    EXPECT_EQ(std::set<int>(draft.part_of.begin(), draft.part_of.end()), std::set<int>{7});
  }
}

TEST(ZipChains, OfReversedChainsAreTheMirrorImage) {
  Random random(6);
  TessellationDraft there, back;
  const MeshChain outer = random_chain(random, 0, 2, there);
  const MeshChain inner = random_chain(random, -0.5, 2, there);
  back = there;
  there.add_strip(outer.reversed(), inner.reversed(), 0);  // the inner one is on the left this way
  double sum = 0;
  for (const auto& t : there.triangles) sum += twice_area(there, t).z() / 2;
  EXPECT_NEAR(sum, 1.0, 1e-12);
  back.add_strip(outer, inner, 0);
  sum = 0;
  for (const auto& t : back.triangles) sum += twice_area(back, t).z() / 2;
  EXPECT_NEAR(sum, -1.0, 1e-12);
}

TEST(AddCell, OfASquareIsCutTheSameWayWhateverTheLastBits) {
  for (const double hair : {0.0, 0.4, -0.4}) {
    TessellationDraft draft;
    const double x = 1 + hair * network_rules::kDiagonalHair;
    for (const Vec3& p : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(x, x, 0), Vec3(0, 1, 0)}) {
      draft.add_point({}, p);
    }
    draft.add_cell({0, 1, 2, 3}, 0);
    EXPECT_EQ(draft.triangles[0], (std::array<int, 3>{0, 1, 2}));
  }
}

TEST(AddCell, CutsAlongTheShorterDiagonal) {
  for (const bool lean : {false, true}) {
    TessellationDraft draft;
    const double shift = lean ? 1.0 : -1.0;
    for (const Vec3& p : {Vec3(0, 0, 0), Vec3(2, 0, 0), Vec3(2 + shift, 1, 0), Vec3(shift, 1, 0)}) {
      draft.add_point({}, p);
    }
    draft.add_cell({0, 1, 2, 3}, 0);
    ASSERT_EQ(draft.triangles.size(), 2U);
    double sum = 0;
    for (const auto& t : draft.triangles) sum += twice_area(draft, t).z() / 2;
    EXPECT_NEAR(sum, 2, 1e-12);
    // Leaning to the right makes 1-3 the shorter one, which 0 is then not joined across.
    int with_both = 0;
    for (const auto& t : draft.triangles) {
      const std::set<int> corners(t.begin(), t.end());
      with_both += lean ? corners.contains(1) && corners.contains(3)
                        : corners.contains(0) && corners.contains(2);
    }
    EXPECT_EQ(with_both, 2);
  }
}

TEST(AddCaps, FillAPolygonInItsPlane) {
  for (const int corners : {3, 6, 25, 80}) {
    SCOPED_TRACE(corners);
    TessellationDraft draft;
    std::vector<int> loop;
    for (int k = 0; k < corners; ++k) {
      const double a = 2 * std::numbers::pi * k / corners;
      loop.push_back(draft.add_point({0, {}}, {2 * std::cos(a), 2 * std::sin(a), 1}));
    }
    Rim rim;
    rim.normal = Vec3::UnitZ();
    add_caps({rim}, {loop}, 4, draft);
    double sum = 0;
    for (const auto& t : draft.triangles) {
      const Vec3 area = twice_area(draft, t) / 2;
      EXPECT_GT(area.z(), 0);
      EXPECT_NEAR(area.head<2>().norm(), 0, 1e-12);
      sum += area.z();
    }
    EXPECT_NEAR(sum, corners / 2.0 * 4 * std::sin(2 * std::numbers::pi / corners), 1e-10);
    for (std::size_t k = static_cast<std::size_t>(corners); k < draft.points.size(); ++k) {
      EXPECT_EQ(draft.origins[k].patch, -1);
      EXPECT_EQ(draft.normals[k], rim.normal);
    }
    EXPECT_EQ(std::set<int>(draft.part_of.begin(), draft.part_of.end()), std::set<int>{4});
  }
}

TEST(TessellationEdges, GivesNeighboursTheSamePointsAndClosesRims) {
  for (const SurfaceNetwork& network : {samples::tube(), samples::tube_with_t_vertex()}) {
    std::vector<BSplineSurface<3>> surfaces;
    for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
      surfaces.push_back(patch_surface(network, p));
    }
    const auto spacing = spacing_of(network, surfaces, {}, {});
    ASSERT_TRUE(spacing);
    TessellationDraft draft;
    const TessellationEdges edges(network, surfaces, spacing->patches, draft);

    // A point along a whole join is a point along the other side as well.
    int shared = 0;
    for (const Join& join : network.joins) {
      const MeshChain a = edges.side_chain(join.a.patch, join.a.side);
      const MeshChain b = edges.side_chain(join.b.patch, join.b.side);
      EXPECT_TRUE(std::is_sorted(a.at.begin(), a.at.end()));
      const std::set<int> of_a(a.points.begin(), a.points.end());
      for (const int p : b.points) shared += of_a.contains(p) ? 1 : 0;
      if (a.points.size() == b.points.size()) {
        EXPECT_EQ(of_a, std::set<int>(b.points.begin(), b.points.end()));
      }
    }
    EXPECT_GT(shared, 10);

    // However coarse the demand, no two edges can share a segment.
    for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
      for (const PatchSide side :
           {PatchSide::kU0, PatchSide::kU1, PatchSide::kV0, PatchSide::kV1}) {
        EXPECT_GT(std::ssize(edges.side_chain(p, side).points), network_rules::kLeastEdgeSegments);
      }
    }

    const auto loops = edges.rim_loops();
    ASSERT_EQ(loops.size(), network.rims.size());
    for (std::size_t r = 0; r < loops.size(); ++r) {
      EXPECT_EQ(std::set<int>(loops[r].begin(), loops[r].end()).size(), loops[r].size());
      Vec3 area = Vec3::Zero();
      for (std::size_t k = 0; k < loops[r].size(); ++k) {
        const Vec3 a = draft.points[static_cast<std::size_t>(loops[r][k])];
        const Vec3 b = draft.points[static_cast<std::size_t>(loops[r][(k + 1) % loops[r].size()])];
        area += (a - network.rims[r].center_mm).cross(b - network.rims[r].center_mm) / 2;
      }
      EXPECT_GT(area.dot(network.rims[r].normal), 0.9 * std::numbers::pi);
    }
  }
}

}  // namespace
}  // namespace angiospline
