// Smooth functions on a wall: against the sphere, whose waves are known.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "recovery/fit/closed_surface.h"
#include "recovery/wall/wall_mesh.h"
#include "recovery/wall/wall_mesh_part.h"

namespace angiospline {
namespace {

constexpr double kRadius = 6;
const Vec3 kCenter(3, -2, 5);

class OnASphere : public testing::Test {
 protected:
  OnASphere()
      : network(closed_surface(kCenter, kRadius * Mat3::Identity(), "ball")),
        mesh(make_fit_mesh(network, {}).value()),
        smoother(mesh),
        ones(Eigen::VectorXd::Ones(mesh.size())) {}

  Vec3 direction(Eigen::Index k) const { return mesh.nodes[static_cast<std::size_t>(k)].normal; }
  Eigen::VectorXd values(double (*f)(const Vec3&)) const {
    Eigen::VectorXd v(mesh.size());
    for (Eigen::Index k = 0; k < v.size(); ++k) v(k) = f(direction(k));
    return v;
  }

  SurfaceNetwork network;
  FitMesh mesh;
  MeshSmoother smoother;
  Eigen::VectorXd ones;
};

// Spherical harmonics of degree 1 and 3: the Laplacian multiplies them by -n (n + 1) / R^2.
double first(const Vec3& d) { return d.z(); }
double third(const Vec3& d) { return 5 * std::pow(d.z(), 3) - 3 * d.z(); }

TEST_F(OnASphere, NodesKnowTheirNormalsAndRadii) {
  ASSERT_GT(mesh.size(), 100);
  for (std::size_t k = 0; k < mesh.nodes.size(); ++k) {
    const Vec3 out = mesh.nodes[k].point_mm - kCenter;
    EXPECT_NEAR(out.norm(), kRadius, 0.02);
    EXPECT_GT(out.normalized().dot(mesh.nodes[k].normal), 0.999);
    EXPECT_NEAR(mesh.radii_mm[k], kRadius, 0.6);
    EXPECT_FALSE(mesh.near_rim[k]);
  }
  EXPECT_NEAR(smoother.mass_mm2().sum(), 4 * std::numbers::pi * kRadius * kRadius, 5);
}

TEST_F(OnASphere, ConstantsStayWhateverTheLength) {
  const Eigen::VectorXd constant = 2.5 * ones;
  EXPECT_LT((smoother.mean(constant, ones, 4) - constant).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((smoother.fair(constant, ones, 8 * ones) - constant).cwiseAbs().maxCoeff(), 1e-7);
}

TEST_F(OnASphere, AMeanKeepsTheShareOfEachWaveThatTheEquationGives) {
  const double l = 2;
  for (const auto& [f, degree] : {std::pair(&first, 1), std::pair(&third, 3)}) {
    const Eigen::VectorXd v = values(f);
    const double share = 1 / (1 + l * l * degree * (degree + 1) / (kRadius * kRadius));
    EXPECT_LT((smoother.mean(v, ones, l) - share * v).norm() / v.norm(), 0.02);
  }
}

TEST_F(OnASphere, AFairFunctionKeepsTheShareOfEachWaveThatTheEquationGives) {
  const double length = 2 * std::numbers::pi * 2.5;
  for (const auto& [f, degree] : {std::pair(&first, 1), std::pair(&third, 3)}) {
    const Eigen::VectorXd v = values(f);
    const double eigenvalue = degree * (degree + 1) / (kRadius * kRadius);
    const double share =
        1 / (1 + std::pow(length / (2 * std::numbers::pi), 4) * eigenvalue * eigenvalue);
    EXPECT_LT((smoother.fair(v, ones, length * ones) - share * v).norm() / v.norm(), 0.03);
  }
}

TEST_F(OnASphere, DegreesOfFreedomAreTheSumOfWhatWavesKeep) {
  const double l = 2.0;
  smoother.fair(values(&first), ones, 2 * std::numbers::pi * l * ones);
  double sum = 0;
  for (int n = 0; n < 60; ++n) {
    const double eigenvalue = n * (n + 1) / (kRadius * kRadius);
    sum += (2 * n + 1) / (1 + std::pow(l, 4) * eigenvalue * eigenvalue);
  }
  EXPECT_NEAR(smoother.degrees_of_freedom() / sum, 1, 0.25);
}

TEST_F(OnASphere, NodesWithoutWeightFollowTheirNeighbours) {
  Eigen::VectorXd v = 3 * ones, w = ones;
  for (Eigen::Index k = 0; k < v.size(); ++k) {
    if (direction(k).x() > 0.5) v(k) = 77, w(k) = 0;
  }
  EXPECT_LT((smoother.mean(v, w, 1) - 3 * ones).cwiseAbs().maxCoeff(), 1e-3);
}

TEST_F(OnASphere, NormalsStayWhereASphereGrowsAndTurnWhereItTilts) {
  const Points3 grown = moved_normals(mesh, 0.5 * ones);
  for (Eigen::Index k = 0; k < grown.cols(); ++k)
    EXPECT_GT(grown.col(k).dot(direction(k)), 0.99999);
  // r = R + a z / R: the normal leans against the slope by the slope, a / R^2 at the equator.
  const double a = 0.3;
  const Points3 leaning = moved_normals(mesh, a * values(&first));
  for (Eigen::Index k = 0; k < leaning.cols(); ++k) {
    if (std::abs(direction(k).z()) > 0.1) continue;
    EXPECT_NEAR(leaning.col(k).z() - direction(k).z(), -a / kRadius, 0.012);
  }
}

TEST_F(OnASphere, APartHasTheTrianglesNearItsPlaces) {
  Points3 place(3, 1);
  place.col(0) = kCenter + Vec3(0, 0, kRadius);
  const FitMeshPart part = part_near(mesh, place, 3);
  ASSERT_GT(part.mesh.size(), 5);
  ASSERT_LT(part.mesh.size(), mesh.size() / 2);
  for (std::size_t k = 0; k < part.nodes.size(); ++k) {
    const WallPoint& whole = mesh.nodes[static_cast<std::size_t>(part.nodes[k])];
    EXPECT_EQ(part.mesh.nodes[k].point_mm, whole.point_mm);
    EXPECT_LE((whole.point_mm - place.col(0)).norm(), 3);
  }
  const std::vector<int> nearest = nearest_nodes(mesh, part.mesh);
  EXPECT_EQ(nearest, part.nodes);
  const Eigen::VectorXd spread = part.spread(Eigen::VectorXd::Ones(part.mesh.size()), mesh.size());
  EXPECT_EQ(spread.sum(), part.mesh.size());
}

}  // namespace
}  // namespace angiospline
