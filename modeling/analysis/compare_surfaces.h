// Geometry regression: how far two surfaces are apart, and whether they are the same kind of thing.
#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {

struct CompareOptions {
  // Largest distance between neighbouring samples; 0 takes 1/300 of the bounding box's diagonal.
  double spacing_mm = 0.0;
};

// Distances from the points of one surface to the nearest points of another. Each triangle is cut
// into equal ones no longer than the spacing; mean and root mean square are sums over their centres
// weighted by area, the maximum also looks at the corners of the mesh. No point of the surface is
// farther away than max_mm + spacing / sqrt(3).
struct DirectedDistance {
  double max_mm = 0.0;
  double mean_mm = 0.0;
  double rms_mm = 0.0;
  Vec3 worst_mm = Vec3::Zero();  // where on the first surface the maximum is
};

struct Comparison {
  DirectedDistance a_to_b;
  DirectedDistance b_to_a;
  double spacing_mm = 0.0;        // used
  double max_distance_mm = 0.0;   // the larger of both ways: the (sampled) Hausdorff distance
  double mean_distance_mm = 0.0;  // of both ways together: half the sum
  double rms_distance_mm = 0.0;   // of both ways together: root of half the sum of squares
  double volume_ratio = 0.0;      // b over a, by signed volume; NaN where a has none
  double area_ratio = 0.0;        // b over a
  // As many components, of the same genus; as many open boundary loops; and, where both have caps
  // of their own, as many inlets, outlets and other caps.
  bool same_topology = false;
};

// Errors: a mesh without triangles; stopped on request. Requires sound meshes. About linear in the
// number of samples for surfaces that lie close.
Result<Comparison> compare(const TriangleMesh& a, const TriangleMesh& b,
                           const CompareOptions& options = {}, const Progress& progress = {});

// The distance from each point of `mesh` to `reference`, signed: positive outside the triangle it
// is nearest to. Name "distance_mm". Requires a reference with triangles.
MeshField distance_field(const TriangleMesh& mesh, const TriangleMesh& reference);

}  // namespace angiospline
