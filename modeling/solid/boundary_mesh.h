// Triangles of a boundary model whose faces share the points of their edges.
#pragma once

#include <array>
#include <vector>

#include "base/vector.h"
#include "modeling/solid/boundary_model.h"

namespace angiospline {

struct BoundaryMesh {
  Points3 points;
  std::vector<std::array<int, 3>> triangles;  // columns of points; counter-clockwise from outside
  std::vector<int> face_of;                   // for each triangle
};

struct BoundaryMeshOptions {
  double turn_rad = 0.35;  // a curve turns by at most about this from chord to chord
  int finer = 1;           // then each chord is divided by this
};

// Meshes the given faces; an edge is divided for those of its faces that are among them. A model
// that came with a mesh gives that one, whatever the options.
BoundaryMesh mesh_boundary(const BoundaryModel& model, const std::vector<int>& faces,
                           const BoundaryMeshOptions& options = {});

// How many triangles mesh_boundary() would make of all faces, nearly.
std::size_t expected_triangles(const BoundaryModel& model, const BoundaryMeshOptions& options);

// Largest distance, sampled at the middle of each mesh cell, between a face's mesh and its surface.
double chord_height_mm(const BoundaryModel& model, int face, const BoundaryMeshOptions& options);

}  // namespace angiospline
