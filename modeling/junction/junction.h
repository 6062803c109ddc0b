// One construction for every junction of three or more branches.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

// A branch as its junction sees it: a ray with a radius. Where junctions became
// one their branches do not meet in a point: such a ray begins at an offset
// from the centre, and a core of the branch's radius leads there.
struct JunctionBranch {
  std::string name;
  Vec3 direction = Vec3::Zero();  // unit, away from the centre
  double radius_mm = 0.0;
  double longest_mm = 0.0;        // the opening must lie no farther from the centre; 0: no bound
  Vec3 offset_mm = Vec3::Zero();  // from the centre to where the ray begins
};

// The point of a branch's ray at this distance from the centre, counted from
// the centre; where the ray begins if all of it is farther away.
Vec3 place_on_branch_mm(const JunctionBranch& branch, double distance_mm);

struct JunctionSpec {
  std::string name;
  Vec3 center_mm = Vec3::Zero();
  std::vector<JunctionBranch> branches;
};

// Where a body meets the junction: a plane circle of arcs, one for each sector
// of the branch. Sector k lies between seams k and k + 1, counter-clockwise
// seen against `axis` (from outside, looking at the junction), and is side kU0
// of patches[k], whose v runs the same way. Contract with the body: the arcs
// lie in the plane of the opening, neighbouring arcs meet with equal
// derivatives at the seams, and the junction's tangent plane along them
// contains `axis`.
struct JunctionOpening {
  Vec3 center_mm = Vec3::Zero();
  Vec3 axis = Vec3::Zero();  // unit, away from the junction: the branch's direction
  double radius_mm = 0.0;
  std::vector<Vec3> seams;   // unit, orthogonal to axis: from the centre to each seam point
  std::vector<int> patches;  // of Junction::network
};

struct Junction {
  SurfaceNetwork network;                 // all patches in one region; openings are not rims
  std::vector<JunctionOpening> openings;  // one for each branch, in the order of the spec
  double worst_angle_deg = 0.0;           // between the normals of neighbouring patches
  double jacobian_ratio = 0.0;            // least |Su x Sv| over its mean on the same patch
  double curvature_times_radius = 0.0;    // largest curvature times the smallest branch radius
  double distance_over_radius = 0.0;      // from the union of cylinders, over the smallest radius
  double moved_over_radius = 0.0;  // off the blend of the cylinders it was made for, likewise
  bool fair = true;  // curvature below 20 over, distance below half, the smallest radius
  int attempts = 1;  // settings tried
};

struct JunctionOptions {
  double margin = 1.0;     // opening beyond the blend, in radii of the branch
  double blend = 0.15;     // width of the blend between branches, in radii of the thinner one
  double rounding = 0.09;  // radius of curvature at the crotch of an acute pair, in radii
  int settings = 16;       // of the solve that are tried, at most
};

// How far from the centre each branch's opening lies, in mm; the order
// of the spec. Errors: fewer than three branches or more than 24, a radius that
// is not positive and finite, two branches in the same direction; each names
// the junction and the branches.
Result<std::vector<double>> opening_distances_mm(const JunctionSpec& spec,
                                                 const JunctionOptions& options = {});

// The junction's patches. Errors: those of opening_distances_mm; a branch too
// short for its opening; no setting gives a surface that passes every gate (the
// message names the best try's failure); stopped on request.
Result<Junction> make_junction(const JunctionSpec& spec, const JunctionOptions& options = {},
                               const Progress& progress = {});

// The junction before its legs are smooth, ungated: a surface like the thesis's
// template (3.3.2), with its saddles and openings tangent-plane continuous and
// the 2 n boundaries from the openings to the poles rough. For experiments;
// errors: those of opening_distances_mm.
Result<Junction> make_rough_junction(const JunctionSpec& spec, const JunctionOptions& options = {});

}  // namespace angiospline
