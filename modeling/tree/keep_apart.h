// Vessels that run into each other, moved apart and, where that is not enough, thinned.
#pragma once

#include "kernel/spline/curve.h"
#include "modeling/tree/smooth_centerlines.h"

namespace angiospline {

struct KeepApartOptions {
  double clearance = 0.1;     // between walls, in radii of the thinner vessel
  double largest_move = 0.5;  // from where the file had the centerline, in local radii
  double thinnest = 0.4;      // of the radius; no vessel is thinned below this share of it
};

// The tree with its paths moved and thinned until find_overlaps with the same clearance is empty or
// the two limits are reached. Each vessel of a pair moves by a share that grows with the other's
// radius, over four radii to either side; what lies within two radii of a junction moves with it,
// by no more than all its branches may. Then radii give way over three. A warning names each branch
// that was moved or thinned, by how much, and each pair that still is too near. Paths that touch
// nothing are unchanged. O(rounds x tree).
SmoothedTree keep_apart(SmoothedTree tree, const KeepApartOptions& options = {});

// The same path (x, y, z and radius over its length) with a knot at least every mean radius: a
// straight one may have a handful of control points, too few to move or thin a part of it.
BSplineCurve<4> with_knots_each_radius(const BSplineCurve<4>& path);

}  // namespace angiospline
