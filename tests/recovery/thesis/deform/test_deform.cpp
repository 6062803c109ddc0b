#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "base/random.h"
#include "kernel/numerics/spectrum.h"
#include "kernel/spline/evaluator.h"
#include "modeling/build/build_model.h"
#include "recovery/phantoms/phantom.h"
#include "recovery/thesis/deform/method.h"
#include "recovery/thesis/deform/potentials.h"
#include "recovery/thesis/deform/rules.h"
#include "recovery/thesis/deform/solver.h"
#include "recovery/thesis/deform/system.h"
#include "recovery/thesis/experiments/slice.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;

// A tube of `rows` circles of `columns` nodes along z.
DeformMesh tube(int rows, int columns, double radius, double step) {
  DeformMesh mesh;
  mesh.nodes_mm.resize(3, rows * columns);
  std::vector<std::pair<int, int>> springs;
  const auto node = [&](int r, int c) { return r * columns + (c + columns) % columns; };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const double a = 2 * kPi * c / columns;
      mesh.nodes_mm.col(node(r, c)) = Vec3(radius * std::cos(a), radius * std::sin(a), step * r);
      springs.emplace_back(std::min(node(r, c), node(r, c + 1)),
                           std::max(node(r, c), node(r, c + 1)));
      if (r + 1 == rows) continue;
      springs.emplace_back(node(r, c), node(r + 1, c));
      mesh.faces.push_back({node(r, c), node(r, c + 1), node(r + 1, c + 1), node(r + 1, c)});
    }
  std::sort(springs.begin(), springs.end());
  mesh.springs.resize(2, std::ssize(springs));
  for (std::size_t s = 0; s < springs.size(); ++s)
    mesh.springs.col(static_cast<Eigen::Index>(s)) << springs[s].first, springs[s].second;
  return mesh;
}

Points3 random_points(Random& random, Eigen::Index count, double spread) {
  Points3 p(3, count);
  for (Eigen::Index k = 0; k < p.size(); ++k) p.data()[k] = random.uniform(-spread, spread);
  return p;
}

// Edges on the circle of this radius about a centre, of equal strength.
EdgePoints ring_of_edges(const Vec3& centre, double radius, int count, double z_step = 0,
                         int rings = 1) {
  EdgePoints e;
  e.at_mm.resize(3, count * rings);
  e.normals.resize(3, count * rings);
  e.strength = Eigen::VectorXd::Ones(count * rings);
  for (int r = 0; r < rings; ++r)
    for (int k = 0; k < count; ++k) {
      const double a = 2 * kPi * (k + 0.3) / count;
      const Vec3 out(std::cos(a), std::sin(a), 0);
      e.at_mm.col(r * count + k) = centre + radius * out + Vec3(0, 0, z_step * r);
      e.normals.col(r * count + k) = -out;
    }
  return e;
}

Model bifurcation() {
  const auto phantom = make_phantom(PhantomKind::kBifurcation);
  auto model = build_model(phantom->tree);
  EXPECT_TRUE(model && model->failed.empty());
  return *model;
}

TEST(DeformMesh, ContoursHaveTwoNeighboursAndPointOutward) {
  const DeformMesh mesh = circle_contour({3, 4, 0}, 2, 7);
  for (const auto& n : neighbours(mesh)) EXPECT_EQ(n.size(), 2U);
  const Points3 normals = node_normals(mesh);
  for (int k = 0; k < 7; ++k)
    EXPECT_NEAR(normals.col(k).dot((mesh.nodes_mm.col(k) - Vec3(3, 4, 0)).normalized()), 1, 1e-12);
  for (Eigen::Index s = 0; s + 1 < mesh.springs.cols(); ++s)
    EXPECT_TRUE(std::pair(mesh.springs(0, s), mesh.springs(1, s)) <
                std::pair(mesh.springs(0, s + 1), mesh.springs(1, s + 1)));
}

TEST(DeformMesh, TubesAreGridsWhateverTheirNumbering) {
  DeformMesh mesh = tube(5, 6, 2, 1);
  // Turn the numbers over.
  const auto turned = [&](int k) { return 29 - k; };
  Points3 nodes = mesh.nodes_mm;
  for (int k = 0; k < 30; ++k) mesh.nodes_mm.col(turned(k)) = nodes.col(k);
  mesh.springs = mesh.springs.unaryExpr(turned).colwise().reverse().eval();
  for (auto& f : mesh.faces)
    for (int& k : f) k = turned(k);
  const auto grid = periodic_grid(mesh);
  ASSERT_TRUE(grid);
  EXPECT_EQ(grid->rows, 5);
  EXPECT_EQ(grid->columns, 6);
  for (int r = 0; r < 5; ++r)
    for (int c = 0; c < 6; ++c) {
      const auto at = [&](int row, int column) {
        return Vec3(
            mesh.nodes_mm.col(grid->order[static_cast<std::size_t>(row * 6 + (column + 6) % 6)]));
      };
      EXPECT_NEAR((at(r, c) - at(r, c + 1)).norm(), 2, 1e-12);  // a hexagon of radius 2
      if (r > 0) {
        EXPECT_NEAR((at(r, c) - at(r - 1, c)).norm(), 1, 1e-12);
      }
    }
  EXPECT_FALSE(periodic_grid(control_mesh(bifurcation().network)));
}

TEST(DeformMesh, CapsCloseIt) {
  const DeformMesh mesh = tube(5, 24, 2, 1);
  EXPECT_FALSE(measure(triangles_of(mesh, Caps::kOpen)).closed());
  const MeshMeasure closed = measure(triangles_of(mesh, Caps::kFans));
  EXPECT_TRUE(closed.closed());
  EXPECT_NEAR(closed.volume_mm3, 0.5 * 24 * 4 * std::sin(2 * kPi / 24) * 4, 1e-9);
}

TEST(NetworkMesh, IsTheSameSurfaceWithinItsTolerance) {
  const Model model = bifurcation();
  double before = 1e9;
  for (const double tolerance : {1.0, 0.3}) {
    const auto fine = refine_network(model.network, {tolerance});
    ASSERT_TRUE(fine) << fine.error().message();
    EXPECT_LE(fine->distance_mm, tolerance);
    EXPECT_LT(fine->distance_mm, before);
    before = fine->distance_mm;
    EXPECT_FALSE(find_defect(fine->network)) << find_defect(fine->network)->message();
    for (std::size_t p = 0; p < model.network.patches.size(); ++p) {
      const auto a = patch_surface(model.network, static_cast<int>(p));
      const auto b = patch_surface(fine->network, static_cast<int>(p));
      for (const double u : {0.0, 0.31, 0.77, 1.0})
        for (const double v : {0.0, 0.5, 0.93}) EXPECT_LT((a.at(u, v) - b.at(u, v)).norm(), 1e-10);
    }
  }
}

TEST(NetworkMesh, NodesOfABifurcationHaveThreeFourOrSixNeighbours) {
  const Model model = bifurcation();
  ASSERT_EQ(model.network.patches.size(), 12U);
  NetworkMeshOptions options;
  options.least_pieces = 2;
  const auto fine = refine_network(model.network, options);
  ASSERT_TRUE(fine);
  const DeformMesh mesh = control_mesh(fine->network);
  std::array<int, 8> with{};
  for (const auto& n : neighbours(mesh)) ++with[std::min<std::size_t>(n.size(), 7)];
  EXPECT_EQ(with[6], 2);  // the poles
  EXPECT_GT(with[3], 30);
  EXPECT_EQ(with[3] + with[4] + with[6], mesh.node_count());
  EXPECT_EQ(openings(mesh).size(), 3U);
  // A pair of pants: Euler characteristic -1.
  EXPECT_EQ(mesh.node_count() - mesh.springs.cols() + std::ssize(mesh.faces), -1);
  const MeshMeasure closed = measure(triangles_of(mesh, Caps::kFans));
  EXPECT_TRUE(closed.closed());
  EXPECT_GT(closed.volume_mm3, 1e4);
}

TEST(NetworkMesh, CoarseningUndoesRefinementAndMeasuresWhatItLoses) {
  const Model model = bifurcation();
  NetworkMeshOptions options;
  options.least_pieces = 3;
  auto fine = refine_network(model.network, options);
  ASSERT_TRUE(fine);
  const auto back = coarsen_network(fine->network, model.network);
  EXPECT_LT(back.distance_mm, 1e-8);
  EXPECT_LT((back.network.control_points_mm - model.network.control_points_mm).norm(), 1e-6);
  // A dent that the coarse surfaces cannot follow.
  fine->network.control_points_mm.col(200) += Vec3(1, 2, 2);
  const auto dented = coarsen_network(fine->network, model.network);
  EXPECT_GT(dented.distance_mm, 0.5);
  EXPECT_LT(dented.distance_mm, 3);
}

TEST(NetworkMesh, BadOptionsAreNamed) {
  const Model model = bifurcation();
  EXPECT_NE(refine_network(model.network, {-1.0}).error().message().find("-1"), std::string::npos);
  NetworkMeshOptions options;
  options.least_pieces = 9;
  options.most_nodes = 500;
  EXPECT_NE(refine_network(model.network, options).error().message().find("500"),
            std::string::npos);
}

TEST(ElementSystem, ElementsAndAssembledMatricesAgree) {
  Random random(3);
  const DeformMesh mesh = tube(6, 9, 3, 1.3);
  const ElementOptions e{0.8, 0.3, 0.2, 1.1, 0.4, 1.0};
  const ElementSystem system(mesh, 0.5, e);
  for (int trial = 0; trial < 5; ++trial) {
    const Points3 nodes = system.rest() + random_points(random, 54, 1);
    const Points3 a = system.internal(nodes, SystemForm::kElements);
    EXPECT_LT((a - system.internal(nodes, SystemForm::kAssembled)).norm(),
              1e-12 * a.norm() + 1e-12);
    EXPECT_GT(a.norm(), 1);
    EXPECT_LT(a.rowwise().sum().norm(), 1e-10);  // inner forces move nothing as a whole
    const Points3 v = random_points(random, 54, 1);
    const Points3 d = system.damping(v, SystemForm::kElements);
    EXPECT_LT((d - system.damping(v, SystemForm::kAssembled)).norm(), 1e-12 * d.norm());
    EXPECT_LT((d.array() * v.array()).sum(), 0);  // takes energy
  }
  EXPECT_LT(system.internal(system.rest(), SystemForm::kElements).norm(), 1e-12);
}

TEST(Divisions, AgreeWhereTheyMust) {
  Random random(5);
  const DeformMesh ring = circle_contour(Vec3::Zero(), 4, 11);  // a prime number of nodes
  const ElementSystem system(ring, 1, {});
  const Points3 b = random_points(random, 11, 2);
  // The damping of a contour is circulant: the transform is the pseudo-inverse.
  const auto svd = divide_by_svd(system.laplacian());
  for (const CirculantNodes nodes : {CirculantNodes::kPlain, CirculantNodes::kPhantom}) {
    const auto dft = divide_by_circulant(*periodic_grid(ring), 2, -1, nodes);
    EXPECT_LT(((*svd)(b) - (*dft)(b)).norm(), 1e-10);
  }
  const Points3 x = (*svd)(b);
  EXPECT_LT((x * system.laplacian() - (b.colwise() - b.rowwise().mean())).norm(), 1e-10);

  // With drag it is regular, and all three divide by the same.
  Eigen::SparseMatrix<double> identity(11, 11);
  identity.setIdentity();
  const Eigen::SparseMatrix<double> A = system.laplacian() + 0.3 * identity;
  const auto sparse = divide_by_sparse(A);
  ASSERT_TRUE(sparse);
  const Points3 y = (**sparse)(b);
  EXPECT_LT((y * A - b).norm(), 1e-12);
  EXPECT_LT((y - (*divide_by_svd(A))(b)).norm(), 1e-10);
  EXPECT_LT(
      (y - (*divide_by_circulant(*periodic_grid(ring), 2.3, -1, CirculantNodes::kPlain))(b)).norm(),
      1e-10);
  EXPECT_FALSE(divide_by_sparse(system.laplacian() - identity));
}

TEST(Divisions, ConjugateGradientsDivideAsTheFactorDoes) {
  Random random(8);
  const DeformMesh mesh = tube(40, 25, 10, 2.5);
  const ElementOptions e{0.4, 0.3, 0.2, 1.0, 0.5, 1.0};
  const ElementSystem system(mesh, 1, e);
  const LaplacianPolynomial p = implicit_step(e, 0.7, 3);
  const Eigen::SparseMatrix<double> A = system.matrix(p);
  const Points3 b = random_points(random, mesh.node_count(), 2);
  const Points3 x = (*divide_by_gradients(A, 1e-8))(b);
  EXPECT_LT((x * A - b).norm(), 2e-8 * b.norm());
  EXPECT_LT((x - (**divide_by_sparse(A))(b)).norm(), 1e-7 * x.norm());
  // The matrix is C + dt (K + s I) as its parts have it.
  const Points3 moved = system.rest() + b;
  ElementOptions soft = e;  // springs as membranes, whose forces are linear
  soft.spring = 0;
  soft.membrane = e.spring + e.membrane;
  const Points3 force = -ElementSystem(mesh, 1, soft).internal(moved, SystemForm::kElements);
  const Points3 drag = -system.damping(b, SystemForm::kElements);
  EXPECT_LT((b * A - (drag + 0.7 * (force + 3 * b))).norm(), 1e-12 * (b * A).norm());
  // Its condition is bounded, and the bound is of the right size.
  const Eigen::VectorXd eigenvalues = symmetric_eigenvalues(Eigen::MatrixXd(A));
  const double condition = eigenvalues.maxCoeff() / eigenvalues.minCoeff();
  EXPECT_GE(system.condition(p), condition);
  EXPECT_LT(system.condition(p), 1.2 * condition);
  EXPECT_TRUE(std::isinf(system.condition(stiffness(e))));
}

TEST(Divisions, OnlyPhantomNodesLetATubeMoveAsAWhole) {
  const DeformMesh mesh = tube(15, 12, 10, 4);
  const ElementSystem system(mesh, 1, {});
  Points3 push = Points3::Zero(3, mesh.node_count());
  push.row(0).setOnes();
  const auto grid = *periodic_grid(mesh);
  EXPECT_LT((*divide_by_svd(system.laplacian()))(push).norm(), 1e-8);
  EXPECT_LT((*divide_by_circulant(grid, 4, -1, CirculantNodes::kPlain))(push).norm(), 1e-8);
  // The rows of zeros at both ends take the mean out of the transform's null space.
  EXPECT_GT((*divide_by_circulant(grid, 4, -1, CirculantNodes::kPhantom))(push).row(0).mean(), 0.2);
  // Away from the ends of rows a plain circulant matrix is the true one.
  Points3 wave = Points3::Zero(3, mesh.node_count());
  for (int c = 0; c < 12; ++c) wave(1, 7 * 12 + c) = std::cos(2 * kPi * 3 * c / 12.0);
  const Points3 truth = (*divide_by_svd(system.laplacian()))(wave);
  const Points3 plain = (*divide_by_circulant(grid, 4, -1, CirculantNodes::kPlain))(wave);
  EXPECT_LT((plain - truth).cwiseAbs().maxCoeff(), 0.25 * truth.cwiseAbs().maxCoeff());
}

TEST(NearestNodes, ReusedAnswersAreThoseOfAskingAnew) {
  Random random(11);
  Points3 nodes = random_points(random, 60, 10);
  const Points3 points = random_points(random, 3000, 12);
  NearestNodes kept(points);
  std::size_t compared = 0;
  for (int step = 0; step < 30; ++step) {
    const auto& a = kept.update(nodes);
    NearestNodes fresh(points);
    EXPECT_EQ(a, fresh.update(nodes));
    compared += a.size();
    nodes += random_points(random, 60, step < 15 ? 0.02 : 0.3);
  }
  EXPECT_EQ(compared, 90000U);
  EXPECT_LT(kept.asked(), compared / 2);  // and the reuse is worth it
  EXPECT_GT(kept.asked(), points.cols());
}

TEST(EdgePotentials, PullAsTheFormulasSay) {
  EdgePoints e = ring_of_edges(Vec3::Zero(), 1, 1);
  e.at_mm.col(0) = Vec3(3, 0, 0);
  Points3 nodes(3, 2);
  nodes.col(0) = Vec3(1, 0, 0);
  nodes.col(1) = Vec3(-5, 0, 0);
  PotentialOptions o;
  o.strength = 2;
  o.reach_vox = 3;
  auto gravity = EdgePotentials::make(e, 1, o);
  // One edge, two nodes: twice the strength on the one that is nearer, nothing on the other.
  Points3 f = gravity->forces(nodes, {});
  EXPECT_NEAR(f(0, 0), 2 * 2 * std::exp(-4.0 / 9), 1e-12);
  EXPECT_EQ(f.col(1), Vec3::Zero());
  o.kind = PotentialKind::kSpring;
  auto spring = EdgePotentials::make(e, 0.5, o);  // lengths double
  f = spring->forces(nodes / 0.5, {});
  EXPECT_NEAR(f(0, 0), 2 * 2 * 4.0 / 3, 1e-12);
  o.farthest_vox = 3.9;
  EXPECT_EQ(EdgePotentials::make(e, 0.5, o)->forces(nodes / 0.5, {}).norm(), 0);
}

TEST(EdgePotentials, GateByAngleLetsGoOfOtherWalls) {
  EdgePoints e = ring_of_edges(Vec3::Zero(), 5, 40);
  const EdgePoints own = e;
  e.normals = -e.normals;  // bright outside
  const DeformMesh ring = circle_contour(Vec3::Zero(), 4.5, 12);
  PotentialOptions o;
  o.most_angle_deg = 60;
  EXPECT_GT(EdgePotentials::make(own, 1, o)->forces(ring.nodes_mm, node_normals(ring)).norm(), 1);
  EXPECT_EQ(EdgePotentials::make(e, 1, o)->forces(ring.nodes_mm, node_normals(ring)).norm(), 0);
  o.bright_inside = false;
  EXPECT_GT(EdgePotentials::make(e, 1, o)->forces(ring.nodes_mm, node_normals(ring)).norm(), 1);
}

TEST(Deform, AllMethodsComeToRestAtTheSamePlace) {
  // Springs to edges that keep their nodes, and membranes: one linear system, one place of rest.
  const DeformMesh start = circle_contour(Vec3(0.4, -0.2, 0), 5, 12);
  const EdgePoints edges = ring_of_edges(Vec3::Zero(), 6, 12);
  DeformOptions o;
  o.elements = {0.0, 0.7, 0.1, 0.5, 1.0, 0.5};
  o.potential.kind = PotentialKind::kSpring;
  o.potential.strength = 4;
  o.potential.most_angle_deg = {};
  o.most_iterations = 200000;
  o.rest_speed = 1e-6;
  std::optional<Points3> first;
  int ran = 0;
  for (const DeformMethod m :
       {DeformMethod::kSparse, DeformMethod::kEulerSvd, DeformMethod::kEulerDft,
        DeformMethod::kEulerDftPhantom, DeformMethod::kCentral, DeformMethod::kCentralDft,
        DeformMethod::kRungeKutta1, DeformMethod::kRungeKutta4})
    for (const SystemForm form : {SystemForm::kElements, SystemForm::kAssembled}) {
      o.method = m;
      o.form = form;
      o.time_step = m == DeformMethod::kSparse ? 1.0 : 0.05;
      o.window = m == DeformMethod::kSparse ? 5 : 20;
      const auto fit = deform(start, edges, 1, o);
      ASSERT_TRUE(fit) << fit.error().message();
      EXPECT_EQ(fit->report.termination, Termination::kAtRest) << to_string(m);
      if (!first) first = fit->mesh.nodes_mm;
      EXPECT_LT((fit->mesh.nodes_mm - *first).cwiseAbs().maxCoeff(), 1e-4) << to_string(m);
      EXPECT_GT(fit->report.moved_mean_mm, 0.2);
      ++ran;
    }
  EXPECT_EQ(ran, 16);
}

TEST(Deform, FindsACircleFromBesideIt) {
  const EdgePoints edges = ring_of_edges(Vec3(2, 1, 0), 6, 200);
  const auto fit = deform(circle_contour(Vec3::Zero(), 4, 24), edges, 1);
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->report.termination, Termination::kAtRest);
  for (int k = 0; k < 24; ++k)
    EXPECT_NEAR((fit->mesh.nodes_mm.col(k) - Vec3(2, 1, 0)).norm(), 6, 0.15);
  EXPECT_LT(fit->report.residual_force.maxCoeff(), 5);
}

TEST(Deform, LargeMeshesComeToRestWithoutAFactor) {
  // 10,800 nodes, so conjugate gradients; half a voxel from their edges.
  const int rows = 90, columns = 120;
  const double radius = columns / (2 * kPi);
  const DeformMesh start = tube(rows, columns, radius, 1);
  ASSERT_GT(start.node_count(), deform_rules::kMostFactorised);
  const EdgePoints edges = ring_of_edges(Vec3::Zero(), radius + 0.5, columns, 1, rows);
  const auto fit = deform(start, edges, 1);
  ASSERT_TRUE(fit) << fit.error().message();
  EXPECT_EQ(fit->report.termination, Termination::kAtRest);
  double worst = 0;
  for (int k = 0; k < start.node_count(); ++k)
    worst = std::max(worst, std::abs(fit->mesh.nodes_mm.col(k).head<2>().norm() - radius - 0.5));
  EXPECT_LT(worst, 0.1);
  EXPECT_GT(worst, 0);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(fit->mesh.nodes_mm, deform(start, edges, 1)->mesh.nodes_mm);
}

TEST(Deform, ThesisPseudoInverseCannotTranslate) {
  // The mean of the nodes is in the null space of the damping: a start beside the vessel stays
  // beside it. Drag against the ground lets go.
  const EdgePoints edges = ring_of_edges(Vec3(1.5, 0, 0), 6, 200);
  DeformOptions o = thesis_options(DeformMethod::kEulerSvd);
  auto fit = deform(circle_contour(Vec3::Zero(), 6, 12), edges, 1, o);
  EXPECT_NEAR(fit->mesh.nodes_mm.row(0).mean(), 0, 1e-9);
  o.elements.drag = 0.3;
  fit = deform(circle_contour(Vec3::Zero(), 6, 12), edges, 1, o);
  EXPECT_GT(fit->mesh.nodes_mm.row(0).mean(), 1);
}

TEST(Deform, InstabilityIsReportedAndTheLastMeshIsFinite) {
  const EdgePoints edges = ring_of_edges(Vec3::Zero(), 6, 100);
  for (const DeformMethod m : {DeformMethod::kRungeKutta1, DeformMethod::kRungeKutta4}) {
    DeformOptions o = thesis_options(m);
    o.time_step = 3;
    const auto fit = deform(circle_contour(Vec3::Zero(), 5, 12), edges, 1, o);
    ASSERT_TRUE(fit);
    EXPECT_EQ(fit->report.termination, Termination::kUnstable);
    EXPECT_TRUE(fit->mesh.nodes_mm.allFinite());
    EXPECT_LT(fit->report.iterations, 100);
  }
}

TEST(Deform, IsTheSameOnOneThreadAndOnMany) {
  const ArterySlice slice = artery_slice(4, 3);
  const auto field = find_edges(slice.image, {EdgePercentile{90}});
  const EdgePoints edges = edge_points(*field, slice.image.grid);
  const DeformMesh start = circle_contour(slice.right.centre_mm, 5, 16);
  const auto many = deform(start, edges, 1);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(many->mesh.nodes_mm, deform(start, edges, 1)->mesh.nodes_mm);
}

TEST(Deform, ResidualForcesShowWhatIsNotBalanced) {
  EdgePoints edges = ring_of_edges(Vec3::Zero(), 5, 60, 1, 5);
  const DeformMesh start = tube(5, 12, 5, 1);
  const auto fit = deform(start, edges, 1);
  ASSERT_TRUE(fit);
  ASSERT_EQ(fit->report.residual_force.size(), 60);
  // Tear all edges of one quarter away by three voxels, and look without moving.
  for (Eigen::Index k = 0; k < edges.count(); ++k)
    if (edges.at_mm(0, k) > 0 && edges.at_mm(1, k) > 0) edges.at_mm.col(k) *= 1.3;
  DeformOptions o;
  o.most_iterations = 1;
  const auto torn = deform(fit->mesh, edges, 1, o);
  double in = 0, out = 0;
  for (int k = 0; k < 60; ++k) {
    const bool quarter = start.nodes_mm(0, k) > 0.5 && start.nodes_mm(1, k) > 0.5;
    (quarter ? in : out) = std::max(quarter ? in : out, torn->report.residual_force[k]);
  }
  EXPECT_GT(in, 0);
  const MeshField field = residual_field(fit->report, triangles_of(start, Caps::kFans));
  EXPECT_EQ(field.values.size(), 62);
  EXPECT_EQ(field.values[61], 0);
}

TEST(Deform, BadInputIsNamed) {
  const EdgePoints edges = ring_of_edges(Vec3::Zero(), 6, 100);
  const DeformMesh start = circle_contour(Vec3::Zero(), 5, 12);
  const auto message = [](const Result<Deformation>& r) {
    return r ? std::string("no error") : r.error().message();
  };
  DeformOptions o;
  o.potential.strength = 0;
  EXPECT_NE(message(deform(start, edges, 1, o)).find("strength"), std::string::npos);
  o = {};
  o.elements.membrane = -2;
  EXPECT_NE(message(deform(start, edges, 1, o)).find("membrane"), std::string::npos);
  EXPECT_NE(message(deform(start, edges, 1, o)).find("-2"), std::string::npos);
  o = {};
  o.time_step = 0;
  EXPECT_NE(message(deform(start, edges, 1, o)).find("time step"), std::string::npos);
  EXPECT_NE(message(deform(start, {}, 1)).find("no edges"), std::string::npos);
  EXPECT_NE(message(deform(control_mesh(bifurcation().network), edges, 1,
                           thesis_options(DeformMethod::kEulerDft)))
                .find("tube"),
            std::string::npos);
  Progress progress;
  progress.stop_requested = [] { return true; };
  EXPECT_EQ(deform(start, edges, 1, {}, progress).error().kind, ErrorKind::kCancelled);
}

TEST(DeformMethods, HaveNamesThatReadBack) {
  int count = 0;
  for (const char* name : {"sparse", "euler-svd", "euler-dft", "euler-dft-phantom", "central",
                           "central-dft", "runge-kutta-1", "runge-kutta-4"}) {
    ASSERT_TRUE(deform_method(name));
    EXPECT_EQ(to_string(*deform_method(name)), name);
    ++count;
  }
  EXPECT_EQ(count, 8);
  EXPECT_FALSE(deform_method("newton"));
}

}  // namespace
}  // namespace angiospline
