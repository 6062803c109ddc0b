// How far each node of a wall must move along its normal to lie on the wall that evidence shows.
#pragma once

#include <vector>

#include "recovery/wall/displacement_options.h"
#include "recovery/wall/evidence.h"

namespace angiospline {

// The answer at each node, and what it rests on.
struct Displacement {
  Eigen::VectorXd normal_mm;        // smooth
  Eigen::VectorXd residual_mm;      // what the evidence asks for beyond it, at the end
  Eigen::VectorXd weight;           // 0: nothing was measured there
  std::vector<double> evidence;     // of each region: near 1 on a wall, near 0 away from any
  double wave_factor = 1.0;         // the one taken
  double degrees_of_freedom = 0.0;  // of the smooth displacement; 0 where one wave only was tried
};

// Smooth displacements by iterated least squares. Each round measures the wall from where the nodes
// have come to, always along the normals of the mesh, and fits the total displacement: waves
// shorter than L = 32 SNR^-0.4 voxels (at most the radii stated, more where the noise is stronger
// than a quarter) are left out, so that a second round is no rougher than the first. Outliers count
// less. Without any evidence nothing moves. Requires a node and a window.
Displacement wall_displacement(Evidence& evidence, const FitMesh& mesh, MeshSmoother& smoother,
                               const DisplacementOptions& options = {},
                               const Progress& progress = {});

}  // namespace angiospline
