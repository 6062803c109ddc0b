// A group of bi-quintic patches moved to where the wall is, under common tangent planes.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "modeling/junction/patch_basis.h"
#include "modeling/junction/tangent_plane_rows.h"
#include "modeling/junction/unknowns.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

// A place of the group's surface and where it should lie.
struct PatchSample {
  int patch = -1;  // of the network
  Vec2 uv = Vec2::Zero();
  Vec3 point_mm = Vec3::Zero();  // where it is
  Vec3 normal = Vec3::Zero();    // unit, of the surface there
  Vec3 move_mm = Vec3::Zero();
  Vec3 moved_normal = Vec3::Zero();  // unit, of the wall that it moves to
  double weight = 1.0;
};

// Patches of a network on their own numbers, ready for the tangent plane rows. Requires bi-quintic
// Bezier patches.
struct PatchGroup {
  JunctionNet net{SharedGrid(JunctionTopology{}, kPatchSize), {}, {}, {}, 0};
  std::vector<int> columns;                             // of the pool, for each point
  std::vector<int> patches;                             // of the network
  std::vector<std::array<int, kPatchPoints>> controls;  // points of each patch
  SmoothEdges edges;

  int index_of(int patch) const;  // -1: not of this group
};

// The group of these patches, every point free (net.slots), scales not set, without edges.
PatchGroup patch_group(const SurfaceNetwork& network, const std::vector<int>& patches);

// Numbers the unknowns of the slots, in the order of the points.
void number_unknowns(PatchGroup& group);

// Adds the equations of the join's edge: whole sides of two patches of the group. A leg starts in
// an opening, with its tangent plane along the given axis.
void add_edge(PatchGroup& group, const Join& join, int ratio_degree);
void add_leg(PatchGroup& group, const Join& join, int ratio_degree, const Vec3& axis);

// Whether the group satisfies its equations as it is.
bool is_smooth(const PatchGroup& group);

// Weights of the squared terms at each sample, lengths in local radii.
struct PatchWeights {
  double distance = 10.0;  // to the plane of the sample
  double anchor = 0.2;     // to the sample itself
  double tangent = 0.5;    // sines between the patch's tangents and the sample's plane
};

struct MovedGroup {
  double share = 0.0;   // of the way that it went
  std::string failure;  // why it did not go the whole way, or nothing
  double worst_angle_deg = 0.0;
  double jacobian_ratio = 0.0;
};

// Moves the net to its samples: least squares under F' + rho G' = nu H' on all edges, by the steps
// of modeling/junction/patch_solver.h. `start` (a column a
// point) is what the points do before, over the whole way; points without unknowns do only that.
// Gates: normals of neighbours within 0.005 degrees, |Su x Sv| over its mean at least
// `least_jacobian`, no normal turned by more than 60 degrees. Each value of `roughness` is tried
// until they pass; if none does, half of the way is tried, then the rest of it from there, and so
// on down to an eighth: the net stays at the last place that passed.
MovedGroup move_group(PatchGroup& group, const std::vector<PatchSample>& samples,
                      const Points3& start, const PatchWeights& weights,
                      std::span<const double> roughness, double least_jacobian);

// The least |Su x Sv| over its mean on the same patch.
double jacobian_ratio(const PatchGroup& group);

}  // namespace angiospline
