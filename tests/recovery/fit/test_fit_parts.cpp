// The parts of a fit: networks moved by given displacements, figures of what was done.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "modeling/network/tessellation.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/figures.h"
#include "recovery/fit/fit_body.h"
#include "recovery/fit/fit_junction.h"
#include "recovery/fit/fit_network.h"
#include "recovery/fit/refinement.h"
#include "recovery/fit/rules.h"

namespace angiospline {
namespace {

CenterlineTree y_tree() {
  CenterlineTree tree;
  const Vec3 center = Vec3::Zero();
  const std::vector<Vec3> ends{{-40, 0, 0}, {25, 30, 2}, {28, -26, 0}};
  const double radii[] = {5, 4, 3.5};
  tree.nodes = {{"center", center}};
  for (std::size_t b = 0; b < 3; ++b) {
    tree.nodes.push_back({"end_" + std::to_string(b), ends[b]});
    CenterlineBranch branch{"branch_" + std::to_string(b), 0, static_cast<int>(b) + 1,
                            Points3(3, 5), Eigen::VectorXd::Constant(5, radii[b])};
    for (int k = 0; k < 5; ++k) branch.points_mm.col(k) = ends[b] * k / 4;
    tree.branches.push_back(branch);
  }
  tree.inlets = {1};
  return tree;
}

class MovedNetworkOf : public testing::Test {
 protected:
  MovedNetworkOf()
      : network(build_model(y_tree()).value().network), mesh(make_fit_mesh(network, {}).value()) {}

  SurfaceNetwork network;
  FitMesh mesh;
};

TEST_F(MovedNetworkOf, NothingIsTheSameToTheLastBit) {
  const auto moved = move_network(network, mesh, Eigen::VectorXd::Zero(mesh.size()));
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->network.control_points_mm, network.control_points_mm);
  EXPECT_TRUE(moved->held.empty());
}

TEST_F(MovedNetworkOf, AnEvenOffsetIsSmoothAndLiesWhereItShould) {
  const double d = 0.25;
  const auto moved = move_network(network, mesh, Eigen::VectorXd::Constant(mesh.size(), d));
  ASSERT_TRUE(moved);
  EXPECT_TRUE(moved->held.empty());
  ASSERT_FALSE(find_defect(moved->network));
  double sum = 0, most = 0;
  for (int k = 0; k < mesh.size(); ++k) {
    const PatchPoint& at = mesh.origins[static_cast<std::size_t>(k)];
    const WallPoint& node = mesh.nodes[static_cast<std::size_t>(k)];
    const Vec3 now = patch_surface(moved->network, at.patch).at(at.uv.x(), at.uv.y());
    const double off = node.normal.dot(now - node.point_mm) - d;
    sum += std::abs(off);
    most = std::max(most, std::abs(off));
  }
  EXPECT_LT(sum / mesh.size(), 0.02);
  EXPECT_LT(most, 0.2);
  const auto certificate = certify(moved->network);
  ASSERT_TRUE(certificate);
  EXPECT_LT(certificate->max_normal_angle_deg, 0.01);
  // Rims stay in their planes and grow.
  for (std::size_t r = 0; r < network.rims.size(); ++r) {
    const Rim &before = network.rims[r], &after = moved->network.rims[r];
    EXPECT_NEAR(before.normal.dot(after.center_mm - before.center_mm), 0, 1e-9);
    EXPECT_NEAR(after.radius_mm - before.radius_mm, d, 0.05);
  }
}

TEST(MoveClosed, GrowsABall) {
  const SurfaceNetwork ball = closed_surface(Vec3(1, 2, 3), 5 * Mat3::Identity(), "ball");
  const FitMesh mesh = make_fit_mesh(ball, {}).value();
  const auto moved = move_network(ball, mesh, Eigen::VectorXd::Constant(mesh.size(), 0.5));
  ASSERT_TRUE(moved);
  EXPECT_TRUE(moved->held.empty());
  const auto surface = tessellate(moved->network);
  ASSERT_TRUE(surface);
  for (Eigen::Index k = 0; k < surface->mesh.points_mm.cols(); ++k) {
    EXPECT_NEAR((surface->mesh.points_mm.col(k) - Vec3(1, 2, 3)).norm(), 5.5, 0.03);
  }
}

TEST(MoveClosed, RefusesNothingThatStays) {
  const SurfaceNetwork ball = closed_surface(Vec3::Zero(), 5 * Mat3::Identity(), "ball");
  std::vector<int> all(ball.patches.size());
  for (std::size_t p = 0; p < all.size(); ++p) all[p] = static_cast<int>(p);
  std::vector<PatchSample> samples;
  for (const int p : all) {
    for (int k = 0; k < 49; ++k) {
      PatchSample s;
      s.patch = p;
      s.uv = Vec2(k / 7, k % 7) / 6;
      const BSplineSurface<3> surface = patch_surface(ball, p);
      s.point_mm = surface.at(s.uv.x(), s.uv.y());
      s.normal = s.moved_normal = s.point_mm.normalized();
      s.weight = 1.0 / 49;
      samples.push_back(s);
    }
  }
  const MovedPatches stayed = move_closed(ball, all, 5, samples);
  EXPECT_EQ(stayed.share, 1);
  EXPECT_TRUE(stayed.failure.empty());
  EXPECT_LE(stayed.worst_angle_deg, fit_rules::kGroupGates.worst_angle_deg);
  for (const auto& [column, point] : stayed.points) {
    // Within the surface points may slide, by less than a hundredth of the radius.
    EXPECT_LT((point - ball.control_points_mm.col(column)).norm(), 0.05);
  }
}

TEST(ShareAround, IsAllAtMarksAndNothingFarFromThem) {
  const SurfaceNetwork ball = closed_surface(Vec3::Zero(), 9 * Mat3::Identity(), "ball");
  const FitMesh mesh = make_fit_mesh(ball, {}).value();
  MeshSmoother smoother(mesh);
  std::vector<char> marks(mesh.nodes.size(), 0);
  for (std::size_t k = 0; k < marks.size(); ++k) marks[k] = mesh.nodes[k].normal.z() > 0.97;
  const Eigen::VectorXd share = share_around(marks, smoother, 1.0);
  for (std::size_t k = 0; k < marks.size(); ++k) {
    const auto c = static_cast<Eigen::Index>(k);
    EXPECT_GE(share(c), 0);
    EXPECT_LE(share(c), 1);
    if (marks[k]) {
      EXPECT_EQ(share(c), 1);
    }
    if (mesh.nodes[k].normal.z() < 0.3) {
      EXPECT_EQ(share(c), 0);
    }
  }
}

TEST(PartFigures, AreMeansOverTheAreaOfEachPart) {
  // Two plane parts, three times as large the second; everything was moved by 2.
  TriangleMesh mesh;
  mesh.points_mm.resize(3, 8);
  mesh.points_mm << 0, 1, 1, 0, 5, 8, 8, 5, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0;
  mesh.triangles.resize(3, 4);
  mesh.triangles << 0, 0, 4, 4, 1, 2, 5, 6, 2, 3, 6, 7;
  mesh.part_of = {0, 0, 1, 1};
  mesh.parts = {{"one", PartKind::kBody, 1}, {"two", PartKind::kJunction, 1}};
  TriangleMesh before = mesh;
  before.points_mm.row(2).array() += 2;
  MeshField residual{"residual_mm", Eigen::VectorXd(8)};
  residual.values << 1, -1, 1, -1, 0.2, 0.2, 0.2, std::numeric_limits<double>::quiet_NaN();
  const std::vector<PartFigures> figures = part_figures(mesh, residual, before);
  ASSERT_EQ(figures.size(), 3U);
  EXPECT_EQ(figures[0].name, "one");
  EXPECT_NEAR(figures[0].residual_mean, 1, 1e-12);
  EXPECT_NEAR(figures[1].residual_mean, 0.2, 1e-12);
  EXPECT_EQ(figures[2].name, "all");
  for (const PartFigures& f : figures) EXPECT_NEAR(f.moved_mean_mm, 2, 1e-12);
  // The part's own area counts, without the point that is not known: 1 and 3 (1 - 1 / 6).
  EXPECT_NEAR(figures[2].residual_mean, (1 + 0.2 * 2.5) / 3.5, 1e-12);
  EXPECT_NEAR(figures[2].residual_most, 1, 1e-12);
}

}  // namespace
}  // namespace angiospline
