#include "io/cad/turn_patches.h"

#include <utility>
#include <vector>

#include "base/index.h"
#include "kernel/spline/knot_algebra.h"

namespace angiospline {
namespace {

bool is_long(const Patch& patch) {
  return patch.u.breakpoints().size() > patch.v.breakpoints().size();
}

// Column (i, j) moves to (j, last - i).
void turn(Patch& patch) {
  const int nu = patch.u.control_point_count(), nv = patch.v.control_point_count();
  std::vector<int> control(patch.control.size());
  for (int i = 0; i < nu; ++i) {
    for (int j = 0; j < nv; ++j) {
      control[index(j * nu + nu - 1 - i)] = patch.control[index(i * nv + j)];
    }
  }
  patch.control = std::move(control);
  KnotVector v = reversed(patch.u);
  patch.u = std::move(patch.v);
  patch.v = std::move(v);
}

// The ends go to the ends to the bit.
double mirrored(double t, const KnotVector& knots) {
  if (t == knots.first()) return knots.last();
  if (t == knots.last()) return knots.first();
  return knots.first() + knots.last() - t;
}

// Where `side` of a patch lies after the turn. Sides along u run the other way then; `u` is the
// patch's knot vector before. Returns whether it does.
bool turn(Side& side, const KnotVector& u) {
  switch (side.side) {
    case PatchSide::kU0:
      side.side = PatchSide::kV1;
      return false;
    case PatchSide::kU1:
      side.side = PatchSide::kV0;
      return false;
    case PatchSide::kV0:
      side.side = PatchSide::kU0;
      break;
    case PatchSide::kV1:
      side.side = PatchSide::kU1;
      break;
  }
  side = {side.patch, side.side, mirrored(side.to, u), mirrored(side.from, u)};
  return true;
}

}  // namespace

SurfaceNetwork turn_long_patches(SurfaceNetwork network) {
  const auto turned = [&](Side& side) {
    const Patch& patch = network.patches[index(side.patch)];
    return is_long(patch) && turn(side, patch.u);
  };

  // A join is reversed anew where only one of its sides runs the other way now.
  for (Join& join : network.joins) {
    const bool a = turned(join.a), b = turned(join.b);
    if (a != b) join.reversed = !join.reversed;
  }
  for (Rim& rim : network.rims) {
    for (Side& side : rim.sides) turned(side);
  }
  for (Patch& patch : network.patches) {
    if (is_long(patch)) turn(patch);
  }
  return network;
}

}  // namespace angiospline
