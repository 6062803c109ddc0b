// A surface network moved to where a mesh of its wall has moved, tangent planes kept.
#pragma once

#include <string>
#include <vector>

#include "recovery/fit/figures.h"
#include "recovery/wall/wall_mesh.h"

namespace angiospline {

struct MovedNetwork {
  SurfaceNetwork network;
  std::vector<HeldRegion> held;
};

// The network whose nodes of `mesh` are displaced along their normals. What holds before holds
// after: patches share their columns, neighbours their tangent planes, openings and rims their
// planes.
//   1. Each opening's circle becomes the ring nearest to the displacements, in its plane.
//   2. Each junction and each closed surface is moved under its tangent plane equations
//      (recovery/fit/fit_junction.h); one that fails a gate goes as far as it can, with its
//      openings, and is named.
//   3. Each body is fitted between the rows so given; at an opening the row next to it keeps its
//      distance from it, at a rim the end row stays in its plane. A body that would fold is tried
//      with stiffer moves, then over parts of the way; at last it keeps its shape but for its
//      ends. If it did not go the whole way it is named.
// Parallel over junctions and bodies, the same on any number of threads. Errors: stopped on
// request.
Result<MovedNetwork> move_network(const SurfaceNetwork& network, const FitMesh& mesh,
                                  const Eigen::VectorXd& displacement_mm,
                                  const Progress& progress = {});

}  // namespace angiospline
