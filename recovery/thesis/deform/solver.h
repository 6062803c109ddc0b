// Deformation: a mesh moves under image potentials until it rests (thesis chapter 5).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/progress.h"
#include "recovery/thesis/deform/method.h"
#include "recovery/thesis/deform/potentials.h"
#include "recovery/thesis/deform/system.h"

namespace angiospline {

struct DeformOptions {
  DeformMethod method = DeformMethod::kSparse;
  SystemForm form = SystemForm::kElements;
  ElementOptions elements{0.0, 0.3, 0.1, 0.0, 1.0, 1.0};
  PotentialOptions potential{PotentialKind::kGravity, 10.0, 4.0, 1.0, {}, 90.0, true};
  double time_step = 1.0;
  int most_iterations = 2000;
  // At rest: over the last and over the last but one `window` iterations the mean place of no node
  // differs by more than rest_speed * window * time_step voxels. (Means, because a node in a sum of
  // pulls that jump never stands quite still.)
  double rest_speed = 0.01;
  int window = 5;
};

// The thesis's configuration: springs and damping of 1, no drag (0.2 with mass, where translations
// would swing for ever), no gates, gravity at 10x.
DeformOptions thesis_options(DeformMethod method);

// The default, or thesis_options(method), with this potential and the time step that an explicit
// step bears: massless methods divide by the damping, whose least eigenvalue l (of those not 0)
// makes forces of steepness s move a mesh by s / l a unit of time; a step beyond 2 l / s
// overshoots. l is exact to rounding for up to 1,500 nodes, then by 60 inverse iterations.
DeformOptions steady_options(DeformMethod method, const DeformMesh& mesh, PotentialKind kind,
                             double strength, double reach_vox);

struct Deformation {
  DeformMesh mesh;
  DeformReport report;
};

// The mesh at rest among the edges; voxel_mm is the unit of lengths inside (the edge of a voxel).
// An unstable run ends with the last mesh that was finite, and says so. Errors: no edges; options
// that are not usable (named); a circulant method on a mesh that is not one tube or contour;
// kCancelled. The same result on any number of threads.
Result<Deformation> deform(const DeformMesh& start, const EdgePoints& edges, double voxel_mm,
                           const DeformOptions& options = {}, const Progress& progress = {});

// The residual force of each point of triangles_of(mesh, caps); 0 at the middles of caps.
MeshField residual_field(const DeformReport& report, const TriangleMesh& mesh);

}  // namespace angiospline
