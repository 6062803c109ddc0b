#include "recovery/wall/wall_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"
#include "base/random.h"
#include "kernel/evaluate/curvature.h"
#include "kernel/geometry/point_index.h"
#include "recovery/wall/rules.h"

namespace angiospline {
namespace {

using namespace wall_rules;

// The wall's part of a tessellation: triangles of regions, and the points they use.
struct WallPart {
  std::vector<int> node_of;  // of each mesh point; -1 for points inside caps
  std::vector<int> points;   // of each node
  Eigen::Matrix3Xi triangles;
};

WallPart wall_of(const Tessellation& mesh, int regions, std::vector<int>& region_of) {
  WallPart wall;
  wall.node_of.assign(index(mesh.mesh.points_mm.cols()), -1);
  std::vector<Eigen::Vector3i> kept;
  for (Eigen::Index t = 0; t < mesh.mesh.triangles.cols(); ++t) {
    const int part = mesh.mesh.part_of[index(t)];
    if (part >= regions) continue;
    Eigen::Vector3i triangle = mesh.mesh.triangles.col(t);
    for (int& p : triangle) {
      int& node = wall.node_of[index(p)];
      if (node < 0) {
        node = static_cast<int>(wall.points.size());
        wall.points.push_back(p);
        region_of.push_back(part);
      }
      p = node;
      region_of[index(node)] = std::min(region_of[index(node)], part);
    }
    kept.push_back(triangle);
  }

  wall.triangles.resize(3, static_cast<Eigen::Index>(kept.size()));
  for (std::size_t t = 0; t < kept.size(); ++t) {
    wall.triangles.col(static_cast<Eigen::Index>(t)) = kept[t];
  }
  return wall;
}

// Each node is judged by the rim nearest to it. O(nodes log rims).
std::vector<char> nodes_near_rims(const SurfaceNetwork& network, const FitMesh& mesh,
                                  double margin_mm) {
  std::vector<char> near(mesh.nodes.size(), 0);
  if (network.rims.empty()) return near;
  Points3 centers(3, std::ssize(network.rims));
  for (std::size_t r = 0; r < network.rims.size(); ++r) {
    centers.col(static_cast<Eigen::Index>(r)) = network.rims[r].center_mm;
  }

  const PointIndex rim_centers(centers);
  for (std::size_t k = 0; k < near.size(); ++k) {
    const Rim& rim = network.rims[index(rim_centers.nearest(mesh.nodes[k].point_mm).point)];
    const Vec3 d = mesh.nodes[k].point_mm - rim.center_mm;
    near[k] = std::abs(rim.normal.dot(d)) <= margin_mm && d.norm() < 2 * rim.radius_mm + margin_mm;
  }
  return near;
}

}  // namespace

Result<FitMesh> make_fit_mesh(const SurfaceNetwork& network, const FitMeshOptions& options,
                              const Progress& progress) {
  TessellationOptions spacing;
  spacing.chord_tolerance = options.chord_tolerance;
  spacing.chord_tolerance_mm = options.chord_tolerance_vox * options.voxel_mm;
  double largest = 0;
  for (const Region& region : network.regions) largest = std::max(largest, region.radius_mm);
  if (largest > 0) {
    spacing.longest_edge = std::clamp(options.longest_edge_vox * options.voxel_mm / largest,
                                      kShortestEdge, kLongestEdge);
  }
  const auto tessellation = tessellate(network, spacing, progress);
  if (!tessellation) return fail(tessellation.error());
  return fit_mesh_of(network, *tessellation, options);
}

FitMesh fit_mesh_of(const SurfaceNetwork& network, const Tessellation& tessellation,
                    const FitMeshOptions& options) {
  FitMesh mesh;
  const WallPart wall =
      wall_of(tessellation, static_cast<int>(network.regions.size()), mesh.regions);
  mesh.points = wall.points;
  mesh.triangles = wall.triangles;

  // Normals and curvatures of the surface itself, not of the triangles.
  std::vector<BSplineSurface<3>> surfaces;
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    surfaces.push_back(patch_surface(network, static_cast<int>(p)));
  }
  for (const int p : wall.points) {
    const PatchPoint& origin = tessellation.origins[index(p)];
    const SurfaceJet jet = surface_jet(surfaces[index(origin.patch)], origin.uv.x(), origin.uv.y());
    const FundamentalForms forms = fundamental_forms(jet);
    const PrincipalCurvatures curvatures = principal_curvatures(jet);
    WallPoint node;
    node.point_mm = tessellation.mesh.points_mm.col(p);
    node.normal = forms.regular ? forms.normal : Vec3(tessellation.mesh.normals.col(p));
    node.largest_curvature = -curvatures.smallest;
    node.smallest_curvature = -curvatures.largest;
    mesh.nodes.push_back(node);
    mesh.origins.push_back(origin);
  }

  // A radius is that of the larger curvature, near to what the region says.
  for (std::size_t k = 0; k < mesh.nodes.size(); ++k) {
    const double known = network.regions[index(mesh.regions[k])].radius_mm;
    const double bent = mesh.nodes[k].largest_curvature;
    const double from_surface = bent > 0 ? 1 / bent : std::numeric_limits<double>::infinity();
    mesh.radii_mm.push_back(known > 0 ? std::clamp(from_surface, known, kLargestRadius * known)
                                      : from_surface);
  }
  mesh.near_rim = nodes_near_rims(network, mesh, options.rim_margin_vox * options.voxel_mm);
  return mesh;
}

Points3 moved_normals(const FitMesh& mesh, const Eigen::VectorXd& displacement) {
  Points3 turned = Points3::Zero(3, mesh.size());
  const auto moved = [&](int k) -> Vec3 {
    return mesh.nodes[index(k)].point_mm + displacement(k) * mesh.nodes[index(k)].normal;
  };

  // Normals of the nodes by the triangles around them, weighted by area, before and after.
  Points3 before = turned;
  for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
    const Eigen::Vector3i c = mesh.triangles.col(t);
    const Vec3 old_a = mesh.nodes[index(c(0))].point_mm;
    const Vec3 old_normal =
        (mesh.nodes[index(c(1))].point_mm - old_a).cross(mesh.nodes[index(c(2))].point_mm - old_a);
    const Vec3 a = moved(c(0));
    const Vec3 normal = (moved(c(1)) - a).cross(moved(c(2)) - a);
    for (const int k : c) {
      before.col(k) += old_normal;
      turned.col(k) += normal;
    }
  }

  for (int k = 0; k < mesh.size(); ++k) {
    turned.col(k) =
        (mesh.nodes[index(k)].normal + turned.col(k).normalized() - before.col(k).normalized())
            .normalized();
  }
  return turned;
}

namespace {

// Of a symmetric matrix; the pattern is analysed the first time.
const FrontalFactor& factored(std::optional<FrontalFactor>& known,
                              const Eigen::SparseMatrix<double>& A) {
  const Eigen::SparseMatrix<double> lower = A.triangularView<Eigen::Lower>();
  if (!known) known.emplace(lower);
  EXPECTS(known->factor(lower));
  return *known;
}

}  // namespace

MeshSmoother::MeshSmoother(const FitMesh& mesh) {
  const int n = mesh.size();
  mass_ = Eigen::VectorXd::Zero(n);

  // The cotangent Laplacian (Pinkall & Polthier: Computing discrete minimal surfaces and their
  // conjugates, Experimental Mathematics 2, 1993); a third of each triangle for its corners.
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(index(mesh.triangles.cols()) * 12);
  for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
    const Eigen::Vector3i c = mesh.triangles.col(t);
    for (int i = 0; i < 3; ++i) {
      const int a = c((i + 1) % 3), b = c((i + 2) % 3);
      const Vec3 corner = mesh.nodes[index(c(i))].point_mm;
      const Vec3 u = mesh.nodes[index(a)].point_mm - corner;
      const Vec3 v = mesh.nodes[index(b)].point_mm - corner;
      const double twice_area = u.cross(v).norm();
      mass_(c(i)) += twice_area / 6;
      if (twice_area == 0) continue;
      const double half = std::max(kLeastCotangent, u.dot(v) / twice_area) / 2;
      entries.emplace_back(a, a, half);
      entries.emplace_back(b, b, half);
      entries.emplace_back(a, b, -half);
      entries.emplace_back(b, a, -half);
    }
  }

  const double mean_mass = mass_.sum() / std::max(1, n);
  mass_ = mass_.cwiseMax(kLeastMass * mean_mass);
  stiffness_.resize(n, n);
  stiffness_.setFromTriplets(entries.begin(), entries.end());
}

Eigen::VectorXd MeshSmoother::mean(const Eigen::VectorXd& values, const Eigen::VectorXd& weights,
                                   double length_mm) {
  Matrix A = length_mm * length_mm * stiffness_;
  A.diagonal() += weights.cwiseMax(kLeastWeight).cwiseProduct(mass_);
  return factored(mean_factor_, A).solve(weights.cwiseProduct(mass_).cwiseProduct(values));
}

Eigen::VectorXd MeshSmoother::fair(const Eigen::VectorXd& values, const Eigen::VectorXd& weights,
                                   const Eigen::VectorXd& lengths_mm) {
  const double turn = 2 * std::numbers::pi;
  const Eigen::VectorXd strength = (lengths_mm / turn).array().pow(4).matrix().cwiseQuotient(mass_);
  const Matrix scaled = strength.asDiagonal() * stiffness_;
  Matrix A = stiffness_ * scaled;
  weighted_mass_ = weights.cwiseProduct(mass_);
  A.diagonal() += weights.cwiseMax(kLeastWeight).cwiseProduct(mass_);
  return factored(fair_factor_, A).solve(weighted_mass_.cwiseProduct(values));
}

double MeshSmoother::degrees_of_freedom() const {
  Random random(2026);
  double sum = 0;
  for (int probe = 0; probe < kTraceProbes; ++probe) {
    Eigen::VectorXd signs(mass_.size());
    for (double& s : signs) s = random.bits() % 2 == 0 ? 1.0 : -1.0;
    sum += signs.dot(fair_factor_->solve(weighted_mass_.cwiseProduct(signs)));
  }
  return sum / kTraceProbes;
}

}  // namespace angiospline
