// A network of B-spline patches on one pool of control points, and how they meet.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/vector.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// One tensor-product patch. Its normal Su x Sv points out of the vessel.
// Control point (i, j), i along u and j along v, is pool column control[i * v_count + j].
struct Patch {
  KnotVector u;
  KnotVector v;
  std::vector<int> control;
  int region = -1;  // index into SurfaceNetwork::regions
};

// A named part of the wall: all patches of one branch's body or of one junction.
enum class RegionKind { kBody, kJunction };
struct Region {
  std::string name;  // face name: "wall_<branch>" or "junction_<node>"
  RegionKind kind = RegionKind::kBody;
  double radius_mm = 0.0;  // the smallest vessel radius in the region
};

// The four sides of a patch, each directed along its growing parameter.
enum class PatchSide { kU0, kU1, kV0, kV1 };

// The part [from, to] of a patch's side, from < to in the side's own parameter.
struct Side {
  int patch = -1;
  PatchSide side = PatchSide::kU0;
  double from = 0.0;
  double to = 1.0;
};

// Two sides that are the same curve: point for point under the affine map of one interval onto the
// other, reversed if so stated. Where whole sides meet they use the same pool columns; where a part
// meets a whole, the dependent columns are listed in SurfaceNetwork::dependencies.
struct Join {
  Side a;
  Side b;
  bool reversed = false;
};

// A pool column that is a fixed combination of others: the boundary with the fewest degrees of
// freedom rules (thesis 3.2). Masters are never dependent themselves.
struct Dependency {
  int point = -1;
  std::vector<std::pair<int, double>> masters;
};

enum class RimKind { kInlet, kOutlet, kCap };  // kCap: an end of which the flow is not known

// An open end: a closed, plane chain of sides, to be closed by a plane cap of this name.
struct Rim {
  std::string name;  // "inlet", "outlet_<node>" ...
  RimKind kind = RimKind::kCap;
  Vec3 center_mm = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  // unit, out of the vessel
  double radius_mm = 0.0;
  std::vector<Side> sides;  // head to tail, around the opening
};

struct SurfaceNetwork {
  Points3 control_points_mm;  // the pool, one column a point
  std::vector<Patch> patches;
  std::vector<Region> regions;
  std::vector<Join> joins;
  std::vector<Rim> rims;
  std::vector<Dependency> dependencies;
};

// The patch with its control points gathered from the pool.
BSplineSurface<3> patch_surface(const SurfaceNetwork& network, int patch);

// Adds `part` to `network`: pool, patches, regions, joins, rims and dependencies are appended and
// renumbered. Returns the offsets that were added to pool columns and patch numbers.
struct AppendOffsets {
  int point = 0;
  int patch = 0;
};
AppendOffsets append(SurfaceNetwork& network, const SurfaceNetwork& part);

// Writes each dependent column as the combination of its masters.
void apply_dependencies(SurfaceNetwork& network);

// The parameter at which a point of `join` on side a, at fraction s in [0, 1] of its interval,
// lies; and the (u, v) of a side's parameter.
double join_parameter_a(const Join& join, double s);
double join_parameter_b(const Join& join, double s);
Vec2 side_parameters(const Patch& patch, PatchSide side, double t);

// The first broken invariant, or nothing: control indices in range and of the right count, knots
// clamped, coordinates finite, regions named, every part of every side in exactly one join or rim,
// rims closed chains with a name, a unit normal and a radius, dependencies on free points. The
// error names patch, side or rim. O(size).
std::optional<Error> find_defect(const SurfaceNetwork& network);

}  // namespace angiospline
