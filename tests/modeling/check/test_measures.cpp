#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "modeling/check/edge_measure.h"
#include "modeling/check/face_measure.h"
#include "modeling/check/rules.h"
#include "modeling/check/self_intersection.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kSteps = 6;

std::vector<FaceMeasure> faces_of(const SurfaceNetwork& network) {
  return measure_faces(*boundary_of(network), kSteps, {});
}

std::vector<EdgeMeasure> edges_of(const SurfaceNetwork& network) {
  const BoundaryModel model = *boundary_of(network);
  return measure_edges(model, measure_faces(model, kSteps, {}), kSteps, {});
}

TEST(FaceMeasures, OfATubeAreThoseOfACylinder) {
  const double radius = 1.5, length = 6;
  const std::vector<FaceMeasure> faces = faces_of(crafted::sheared_tube(radius, length));
  ASSERT_EQ(faces.size(), 4U);
  for (const std::size_t half : {0U, 1U}) {
    EXPECT_NEAR(faces[half].area_mm2, kPi * radius * length, 1e-4);
    EXPECT_NEAR(faces[half].max_curvature, 1 / radius, 2e-3);
    EXPECT_GT(faces[half].jacobian_ratio, 0.5);
  }
  for (const std::size_t cap : {2U, 3U}) {
    EXPECT_NEAR(faces[cap].area_mm2, crafted::unit_disc_area() * radius * radius, 1e-10);
    EXPECT_EQ(faces[cap].max_curvature, 0);
  }
  // The cap at z = 0 has no cone above the origin; the other one a third of the tube.
  EXPECT_NEAR(faces[2].volume_mm3, 0, 1e-12);
  EXPECT_NEAR(faces[3].volume_mm3, faces[3].area_mm2 * length / 3, 1e-10);
}

TEST(FaceMeasures, AddUpToTheVolumeWhereverTheNetworkLies) {
  for (SurfaceNetwork network : {samples::bent_tube(), samples::torus(),
                                 crafted::tube_of_quarters(1, 6), samples::tube_with_t_vertex()}) {
    const double exact = samples::exact_volume_mm3(network);
    for (const Vec3& shift : {Vec3(0, 0, 0), Vec3(8, -3, 5)}) {
      network.control_points_mm.colwise() += shift;
      for (Rim& rim : network.rims) rim.center_mm += shift;
      double sum = 0;
      for (const FaceMeasure& m : faces_of(network)) sum += m.volume_mm3;
      EXPECT_NEAR(sum, exact, 1e-9 * exact);
    }
  }
}

TEST(TightBox, IsReachedAndNotLeftBySamples) {
  const SurfaceNetwork network = samples::bent_tube();
  const BoundaryModel model = *boundary_of(network);
  const auto [low, high] = tight_box(model, measure_faces(model, kSteps, {}), kSteps);
  Vec3 lowest = Vec3::Constant(1e9), highest = -lowest;
  for (int p = 0; p < static_cast<int>(network.patches.size()); ++p) {
    const BSplineSurface<3> s = patch_surface(network, p);
    for (int i = 0; i <= 200; ++i) {
      for (int j = 0; j <= 200; ++j) {
        const Vec3 at = s.at(s.u().last() * i / 200, s.v().last() * j / 200);
        lowest = lowest.cwiseMin(at);
        highest = highest.cwiseMax(at);
      }
    }
  }
  const double size = (highest - lowest).norm();
  EXPECT_GE((lowest - low).minCoeff(), -1e-9 * size);
  EXPECT_GE((high - highest).minCoeff(), -1e-9 * size);
  EXPECT_LT((lowest - low).maxCoeff(), 1e-3 * size);
  EXPECT_LT((high - highest).maxCoeff(), 1e-3 * size);
}

// A grid misses an extreme by less than the slack that decides which patches are searched further.
TEST(TightBox, LooksFurtherThanAGridCanMiss) {
  for (const SurfaceNetwork& network : {samples::bent_tube(), samples::torus()}) {
    const BoundaryModel model = *boundary_of(network);
    const auto coarse = measure_faces(model, kSteps, {}), fine = measure_faces(model, 40, {});
    for (std::size_t f = 0; f < coarse.size(); ++f) {
      if (!model.faces[f].patch) continue;
      const double size = (fine[f].highest_mm - fine[f].lowest_mm).norm();
      const double missed = std::max((coarse[f].lowest_mm - fine[f].lowest_mm).maxCoeff(),
                                     (fine[f].highest_mm - coarse[f].highest_mm).maxCoeff());
      EXPECT_LT(missed, 0.5 * check_rules::kGridSlack * size);
    }
  }
}

TEST(EdgeMeasures, SeeACreaseByItsAngleAndOnlyBetweenWalls) {
  for (const double crease : {0.0, 1.0, 25.0}) {
    const SurfaceNetwork network = crafted::creased_tube(1, 6, crease);
    const BoundaryModel model = *boundary_of(network);
    const std::vector<EdgeMeasure> edges = edges_of(network);
    double worst = 0;
    int smooth = 0, caps = 0;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      EXPECT_TRUE(is_shared(model.edges[e]));
      EXPECT_LT(edges[e].gap_mm, 1e-12);
      EXPECT_GT(edges[e].samples, kSteps);
      if (is_smooth(model, model.edges[e])) {
        ++smooth;
        worst = std::max(worst, edges[e].angle_deg);
      } else {
        ++caps;
        EXPECT_EQ(edges[e].angle_deg, -1);
      }
    }
    EXPECT_EQ(smooth, 6);  // four seams and two halves of the crease
    EXPECT_EQ(caps, 4);
    EXPECT_NEAR(worst, crease, 1e-4);  // sections are circles within 1.8e-6 radii
  }
}

TEST(EdgeMeasures, SeeAGapWhereTwoSidesAreNotOneCurve) {
  SurfaceNetwork network = samples::tube_with_t_vertex();
  network.control_points_mm.col(network.dependencies.front().point) += Vec3(0, 0, 0.02);
  double widest = 0;
  for (const EdgeMeasure& m : edges_of(network)) widest = std::max(widest, m.gap_mm);
  EXPECT_GT(widest, 0.002);
  EXPECT_LT(widest, 0.02);
}

TEST(SelfIntersections, AreFoundWhereTwoTubesCrossAndNamedOnce) {
  SurfaceNetwork two = crafted::sheared_tube(1, 6);
  SurfaceNetwork other = crafted::sheared_tube(0.7, 6);
  // Turned across the first one, through its middle.
  for (Eigen::Index c = 0; c < other.control_points_mm.cols(); ++c) {
    const Vec3 p = other.control_points_mm.col(c);
    other.control_points_mm.col(c) << p.z() - 3, p.x(), p.y() + 3;
  }
  for (Rim& rim : other.rims) {
    rim.center_mm = Vec3(rim.center_mm.z() - 3, rim.center_mm.x(), rim.center_mm.y() + 3);
    rim.normal = Vec3(rim.normal.z(), rim.normal.x(), rim.normal.y());
  }
  other.regions[0].name = "wall_across";
  append(two, other);
  const auto found = find_self_intersections(*boundary_of(two), 100000);
  ASSERT_TRUE(found) << found.error().message();
  ASSERT_EQ(found->crossings.size(), 1U);
  const FaceCrossing& crossing = found->crossings[0];
  EXPECT_EQ(crossing.faces, (std::array<std::string, 2>{"wall_1", "wall_across"}));
  // On both tubes: 1 from the one's axis, 0.7 from the other's.
  EXPECT_NEAR(crossing.at_mm.head<2>().norm(), 1, 0.03);
  EXPECT_NEAR(std::hypot(crossing.at_mm.y(), crossing.at_mm.z() - 3), 0.7, 0.03);
  EXPECT_GT(found->resolution_mm, 0);
}

TEST(SelfIntersections, AreNoneWhereTubesOnlyPassNearEachOther) {
  SurfaceNetwork two = crafted::sheared_tube(1, 6);
  SurfaceNetwork other = crafted::sheared_tube(1, 6);
  other.control_points_mm.row(0).array() += 2.05;
  for (Rim& rim : other.rims) rim.center_mm.x() += 2.05;
  append(two, other);
  const auto found = find_self_intersections(*boundary_of(two), 100000);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->crossings.empty());
}

}  // namespace
}  // namespace angiospline
