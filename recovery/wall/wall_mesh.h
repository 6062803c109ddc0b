// The wall of a network as one finite-element mesh, and smooth functions on it.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/SparseCore>

#include "base/progress.h"
#include "base/result.h"
#include "kernel/numerics/frontal_factor.h"
#include "modeling/network/tessellation.h"
#include "recovery/wall/wall_profile.h"

namespace angiospline {

// Nodes on the wall, bodies and junctions alike, with the surface's normal and curvatures there.
// Patches share the nodes of their joins, so that what is smooth on the mesh is smooth across them.
struct FitMesh {
  std::vector<WallPoint> nodes;
  std::vector<int> points;          // of the tessellation, one for each node
  std::vector<PatchPoint> origins;  // where each lies on the network; one of several on an edge
  std::vector<int> regions;         // of the network; on an edge between two, the lower
  std::vector<double> radii_mm;     // of the vessel around each node, from the surface
  Eigen::Matrix3Xi triangles;       // of the wall, counter-clockwise seen from outside
  std::vector<char> near_rim;       // within the margin of an open end

  int size() const { return static_cast<int>(nodes.size()); }
};

// Nodes are about sqrt(radius / 3) voxels apart: a voxel where vessels are thin, two where they are
// thick and their walls are known from many voxels.
struct FitMeshOptions {
  double voxel_mm = 1.0;
  double chord_tolerance_vox = 0.04;
  double chord_tolerance = 0.02;  // in local radii; the smaller one counts
  double longest_edge_vox = 1.5;  // of the thickest vessel
  double rim_margin_vox = 1.5;    // near an open end nothing is measured
};

// Errors: the network's first defect; stopped on request. O(nodes).
Result<FitMesh> make_fit_mesh(const SurfaceNetwork& network, const FitMeshOptions& options,
                              const Progress& progress = {});

// The same of triangles that are there already: the nodes are the points of the wall.
FitMesh fit_mesh_of(const SurfaceNetwork& network, const Tessellation& tessellation,
                    const FitMeshOptions& options);

// Unit normals of the mesh after its nodes have moved along theirs: the surface's own normals,
// turned as the triangles turn.
Points3 moved_normals(const FitMesh& mesh, const Eigen::VectorXd& displacement_mm);

// The smooth functions nearest to weighted values at the nodes. Linear finite elements: K is the
// cotangent matrix, M the lumped mass (mm^2). The order of all sums is fixed.
class MeshSmoother {
 public:
  explicit MeshSmoother(const FitMesh& mesh);

  const Eigen::VectorXd& mass_mm2() const { return mass_; }

  // Least sum_i w_i m_i (f_i - value_i)^2 + l^2 int |grad f|^2: means over some l around each node;
  // where weights are zero, those of the neighbours. Zero where a whole component has no weight.
  Eigen::VectorXd mean(const Eigen::VectorXd& values, const Eigen::VectorXd& weights,
                       double length_mm);

  // Least sum_i w_i m_i (f_i - value_i)^2 + sum_i (L_i / 2 pi)^4 m_i (laplacian f)_i^2: a wave of
  // length L comes through by half where weights are one, longer ones better, shorter ones less (by
  // the fourth power).
  Eigen::VectorXd fair(const Eigen::VectorXd& values, const Eigen::VectorXd& weights,
                       const Eigen::VectorXd& lengths_mm);

  // The trace of the last fair() as a linear map of its values: how many numbers its answer rests
  // on. By random signs from a fixed seed (Hutchinson 1990): good to some ten percent.
  double degrees_of_freedom() const;

 private:
  using Matrix = Eigen::SparseMatrix<double>;

  Matrix stiffness_;
  Eigen::VectorXd mass_;
  Eigen::VectorXd weighted_mass_;  // of the last fair()
  std::optional<FrontalFactor> mean_factor_, fair_factor_;
};

}  // namespace angiospline
