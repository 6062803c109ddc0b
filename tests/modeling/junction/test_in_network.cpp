// A junction found again among the patches of a network.
#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "modeling/junction/in_network.h"
#include "modeling/junction/junction.h"
#include "modeling/junction/patch_basis.h"
#include "modeling/junction/tangent_plane_rows.h"
#include "tests/modeling/junction/sample_junction.h"

namespace angiospline {
namespace {

class FoundAgain : public testing::Test {
 protected:
  FoundAgain() : made(make_junction(four_spec()).value()) {}
  Junction made;
};

TEST_F(FoundAgain, HasTheBranchesAndPatchesThatItWasMadeWith) {
  const auto found = junction_in_network(made.network, 0);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->patches.size(), made.network.patches.size());
  ASSERT_EQ(found->topology.sectors.size(), made.openings.size());
  // The same patches around each branch, whatever its number.
  std::set<std::set<int>> wanted, got;
  for (const JunctionOpening& o : made.openings) {
    wanted.insert(std::set<int>(o.patches.begin(), o.patches.end()));
  }
  for (const std::vector<int>& sector : found->topology.sectors) {
    std::set<int> patches;
    for (const int p : sector) patches.insert(found->patches[static_cast<std::size_t>(p)]);
    got.insert(patches);
  }
  EXPECT_EQ(got, wanted);
  EXPECT_EQ(std::ssize(found->topology.saddles) * 2, std::ssize(found->patches));
}

TEST_F(FoundAgain, HasItsControlPointsAndIsSmoothStill) {
  const JunctionInNetwork found = junction_in_network(made.network, 0).value();
  const JunctionLayout layout = present_layout(found, made.network);
  const JunctionNet net = present_net(found, layout, made.network);
  for (std::size_t k = 0; k < found.columns.size(); ++k) {
    const Vec3 world =
        found.center_mm + found.radius_mm * Vec3(net.points.col(static_cast<Eigen::Index>(k)));
    EXPECT_LT((world - made.network.control_points_mm.col(found.columns[k])).norm(), 1e-9);
  }
  const SmoothEdges edges = smooth_edges(found.topology, layout, net, {});
  const Eigen::VectorXd c = best_coefficients(edges, net);
  EXPECT_LT(tangent_plane_residual(edges, net, c).cwiseAbs().maxCoeff(), 1e-8);
}

TEST_F(FoundAgain, LaysItsNodesOnTheSurfaceAndItsOpeningsInTheirPlanes) {
  const JunctionInNetwork found = junction_in_network(made.network, 0).value();
  const JunctionLayout layout = present_layout(found, made.network);
  const int last = layout.grid.size() - 1;
  for (int p = 0; p < static_cast<int>(found.patches.size()); ++p) {
    const BSplineSurface<3> patch =
        patch_surface(made.network, found.patches[static_cast<std::size_t>(p)]);
    for (const auto& [a, b] : {std::pair(0, 0), std::pair(last / 2, last), std::pair(last, 3)}) {
      const Vec3 world =
          found.center_mm + found.radius_mm * Vec3(layout.nodes.col(layout.grid.at(p, a, b)));
      EXPECT_LT(
          (world - patch.at(static_cast<double>(a) / last, static_cast<double>(b) / last)).norm(),
          1e-9);
    }
  }
  for (const OpeningFrame& frame : layout.openings) {
    const bool known =
        std::any_of(made.openings.begin(), made.openings.end(), [&](const JunctionOpening& o) {
          const Vec3 off = found.center_mm + found.radius_mm * frame.center - o.center_mm;
          // The mean of the rim's control points lies in its plane, near the circle's centre.
          return std::abs(off.dot(o.axis)) < 1e-9 && off.norm() < 0.2 * o.radius_mm &&
                 frame.axis.dot(o.axis) > 1 - 1e-9;
        });
    EXPECT_TRUE(known);
  }
}

TEST_F(FoundAgain, IsNoneWhereASideIsOpen) {
  made.network.joins.pop_back();
  const auto found = junction_in_network(made.network, 0);
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message().find("open side"), std::string::npos);
}

}  // namespace
}  // namespace angiospline
