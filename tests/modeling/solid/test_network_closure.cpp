#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "modeling/solid/network_closure.h"
#include "modeling/solid/rules.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

// A network with all that a NetworkShape refers to.
struct Owned {
  explicit Owned(SurfaceNetwork n) : network(std::move(n)), topology(*network_topology(network)) {
    for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
      surfaces.push_back(patch_surface(network, p));
    }
  }
  NetworkShape shape() const { return {network, topology, surfaces}; }
  std::vector<CapPlane> planes() const {
    std::vector<CapPlane> planes;
    for (int r = 0; r < static_cast<int>(network.rims.size()); ++r) {
      planes.push_back(cap_plane(shape(), r).value());
    }
    return planes;
  }

  SurfaceNetwork network;
  NetworkTopology topology;
  std::vector<BSplineSurface<3>> surfaces;
};

TEST(NetworkClosure, HasTheVolumeOfTheNetworkWhereverItLies) {
  for (const SurfaceNetwork& network : {crafted::sheared_tube(1, 6, 1), samples::bent_tube(),
                                        crafted::tube_of_quarters(1, 6), samples::torus()}) {
    const double exact = samples::exact_volume_mm3(network);
    SurfaceNetwork far = network;
    far.control_points_mm.colwise() += Vec3(300, -200, 500);
    for (Rim& rim : far.rims) rim.center_mm += Vec3(300, -200, 500);
    for (const SurfaceNetwork& placed : {network, far}) {
      const Owned owned(placed);
      const std::vector<double> volumes = signed_volumes_mm3(owned.shape(), owned.planes());
      ASSERT_EQ(volumes.size(), 1U);
      EXPECT_NEAR(volumes[0], exact, 1e-9 * exact);
    }
  }
}

TEST(NetworkClosure, MeasuresEachComponentByItself) {
  SurfaceNetwork two = crafted::sheared_tube(1, 6);
  append(two, samples::torus());
  const Owned owned(two);
  const std::vector<double> volumes = signed_volumes_mm3(owned.shape(), owned.planes());
  ASSERT_EQ(volumes.size(), 2U);
  EXPECT_NEAR(volumes[0], samples::exact_volume_mm3(crafted::sheared_tube(1, 6)), 1e-9);
  EXPECT_NEAR(volumes[1], samples::exact_volume_mm3(samples::torus()), 1e-8);
}

TEST(CapPlane, IsTheRimsOwnAndTurnsOutOfTheVessel) {
  SurfaceNetwork network = crafted::sheared_tube(1, 6, 1);
  network.rims[0].normal = -network.rims[0].normal;  // said the wrong way round
  const Owned owned(network);
  const std::vector<CapPlane> planes = owned.planes();
  EXPECT_EQ(planes[0].normal, Vec3(0, 0, -1));
  EXPECT_EQ(planes[1].normal, Vec3(0, 0, 1));
  for (std::size_t r = 0; r < 2; ++r) {
    EXPECT_EQ(planes[r].center_mm, owned.network.rims[r].center_mm);
    EXPECT_LT(planes[r].distance_mm, 1e-14);
  }
}

TEST(CapPlane, IsFittedToARimThatHasTilted) {
  const Vec3 normal = Vec3(0.2, -0.1, 1).normalized();
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    auto p = network.control_points_mm.col(c);
    if (p.z() == 6) p.z() -= (normal.x() * p.x() + normal.y() * p.y()) / normal.z();
  }
  const Owned owned(network);
  const auto plane = cap_plane(owned.shape(), 1);
  ASSERT_TRUE(plane) << plane.error().message();
  EXPECT_LT((plane->normal - normal).norm(), 1e-12);
  EXPECT_LT(plane->distance_mm, 1e-12);

  // A rim that is no plane's at all is refused by name.
  SurfaceNetwork bent = crafted::sheared_tube(1, 6);
  for (Eigen::Index c = 0; c < bent.control_points_mm.cols(); ++c) {
    auto p = bent.control_points_mm.col(c);
    if (p.z() == 6) p.z() += 0.1 * p.x() * p.x();
  }
  const Owned refused(bent);
  const auto none = cap_plane(refused.shape(), 1);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message().find("outlet_2"), std::string::npos);
}

TEST(JoinGaps, AreWhatTheSidesWereMovedApartBy) {
  SurfaceNetwork network = samples::tube_with_t_vertex();
  ASSERT_FALSE(network.dependencies.empty());
  const Owned closed(network);
  for (const double gap : join_gaps_mm(closed.shape())) EXPECT_LT(gap, 1e-14);
  EXPECT_FALSE(find_open_join(closed.shape(), join_gaps_mm(closed.shape())));

  // A dependent point is on one side of its join alone.
  network.control_points_mm.col(network.dependencies.front().point) += Vec3(0, 0, 0.3);
  const Owned open(network);
  const std::vector<double> gaps = join_gaps_mm(open.shape());
  const double widest = *std::max_element(gaps.begin(), gaps.end());
  EXPECT_GT(widest, 0.05);
  EXPECT_LT(widest, 0.3);
  const auto error = find_open_join(open.shape(), gaps);
  ASSERT_TRUE(error);
  EXPECT_NE(error->message().find(patch_title(network, 0)), std::string::npos) << error->message();
}

TEST(JoinGaps, OpenAJoinBeyondAShareOfItsRadiusWhateverTheScale) {
  for (const double radius : {0.1, 1.0, 30.0}) {
    for (const bool open : {false, true}) {
      SurfaceNetwork network = samples::tube_with_t_vertex(radius, 5 * radius);
      const Owned closed(network);
      const int point = network.dependencies.front().point;
      const auto widest = [&] {
        const Owned owned(network);
        const std::vector<double> gaps = join_gaps_mm(owned.shape());
        return *std::max_element(gaps.begin(), gaps.end());
      };
      // Gaps grow in proportion to the move: scaled to just below and above the rule.
      network.control_points_mm.col(point) += Vec3(0, 0, radius);
      const double share = (open ? 1.01 : 0.99) * solid_rules::kLargestGap * radius / widest();
      network = closed.network;
      network.control_points_mm.col(point) += Vec3(0, 0, share * radius);
      const Owned moved(network);
      EXPECT_EQ(find_open_join(moved.shape(), join_gaps_mm(moved.shape())).has_value(), open);
    }
  }
}

}  // namespace
}  // namespace angiospline
