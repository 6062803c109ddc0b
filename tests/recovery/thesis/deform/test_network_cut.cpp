#include <gtest/gtest.h>

#include "recovery/thesis/deform/network_cut.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

TEST(PatchDirections, AreOneWhereSidesMeetAndOthersByThemselves) {
  // Two halves that meet along v: they share v, and each has its own u.
  const PatchDirections tube(samples::tube());
  EXPECT_EQ(tube.find(1).of, tube.find(3).of);
  EXPECT_FALSE(tube.find(1).against ^ tube.find(3).against);
  EXPECT_NE(tube.find(0).of, tube.find(2).of);
  EXPECT_NE(tube.find(0).of, tube.find(1).of);
  EXPECT_TRUE(tube.folded().empty());

  // A strip that meets itself turned over must be cut symmetrically.
  SurfaceNetwork strip = samples::tube();
  strip.joins[0].reversed = true;
  const PatchDirections turned(strip);
  ASSERT_EQ(turned.folded().size(), 1U);
  EXPECT_EQ(turned.folded()[0], turned.find(1).of);
}

TEST(CutNetwork, ChangesNoSurfaceAndKeepsNeighboursOnSharedPoints) {
  const SurfaceNetwork tube = samples::bent_tube();
  const PatchDirections directions(tube);
  std::vector<SpanPieces> pieces(4);
  const std::size_t spans = tube.patches[0].v.breakpoints().size() - 1;
  for (const std::size_t d : {0U, 2U}) pieces[directions.find(d).of] = {3};
  pieces[directions.find(1).of].assign(spans, 1);
  pieces[directions.find(1).of][0] = 4;
  const auto fine = cut_network(tube, directions, pieces, 1000);
  ASSERT_TRUE(fine) << fine.error().message();
  EXPECT_FALSE(find_defect(fine->network));

  // u: one span in three; v: the first in four. Two seams are shared.
  const auto nu = static_cast<Eigen::Index>(6 + 2), nv = static_cast<Eigen::Index>(5 + spans + 3);
  EXPECT_EQ(fine->network.control_points_mm.cols(), 2 * (nu - 1) * nv);
  double largest = 0;
  for (int p = 0; p < 2; ++p) {
    const BSplineSurface<3> a = patch_surface(tube, p), b = patch_surface(fine->network, p);
    for (int i = 0; i <= 20; ++i) {
      for (int j = 0; j <= 20; ++j) {
        const double u = i / 20.0, v = a.v().last() * j / 20.0;
        largest = std::max(largest, (a.at(u, v) - b.at(u, v)).norm());
      }
    }
  }
  EXPECT_LT(largest, 1e-12);
  EXPECT_GT(fine->distance_mm, 0);

  const auto refused = cut_network(tube, directions, pieces, 50);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message().find("at most 50"), std::string::npos);
}

}  // namespace
}  // namespace angiospline
