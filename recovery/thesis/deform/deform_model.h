// A model deformed the thesis's way: edges, potentials, a solver, and back to smooth patches.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"
#include "modeling/network/model.h"
#include "recovery/fit/figures.h"
#include "recovery/imaging/image/image.h"
#include "recovery/thesis/deform/method.h"

namespace angiospline {

struct DeformModelOptions {
  DeformMethod method = DeformMethod::kSparse;
  PotentialKind potential = PotentialKind::kGravity;
  double strength = 10.0;           // of the potential
  double reach_vox = 4.0;           // of the potential: at least the error of the start
  std::optional<double> stiffness;  // of the springs; none: as the method has it
  int most_iterations = 2000;
  double edge_percentile = 97.0;  // edges are stronger than so many percent of the voxels
  int pieces = 2;                 // of each knot span of the finite-element mesh
  bool dark = false;              // vessels are darker than their background
};

struct DeformedModel {
  Model model;  // coarsened and smoothed
  DeformReport report;
  TriangleMesh mesh;         // the deformed finite-element mesh
  MeshField residual_force;  // at its points
  int nodes = 0;
  int edges = 0;
  double coarsening_mm = 0.0;     // the way back to B-splines moved no control point farther
  double angle_before_deg = 0.0;  // between neighbours' normals, before they were made smooth
  double angle_after_deg = 0.0;
  std::vector<std::string> without_edge;  // regions near which the image shows none: as seeded
  std::vector<PartFigures>
      parts;  // residual forces and moves of the nodes of each region, and of all
};

// The model's network is refined to a finite-element mesh (of points of its surface), deformed
// among the image's edges (recovery/thesis/deform/solver.h), brought back to its own knots and made
// tangent-plane continuous again with floating boundaries; ends are brought back to their planes.
// Edges beyond an end's plane do not count. The default solver goes by thin edges between voxels
// (recovery/thesis/edges/edge_localisation.h) in three stages, the others by the thesis's thick
// ones in one. Junctions that cannot be made smooth are named in the model's warnings. Errors:
// those of find_edges, refine_network, deform; the model lies outside the image; kCancelled.
Result<DeformedModel> deform_model(const Model& model, const Image<float>& image,
                                   const DeformModelOptions& options = {},
                                   const Progress& progress = {});

}  // namespace angiospline
