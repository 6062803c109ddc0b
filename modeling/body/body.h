// Vessel bodies: generalised cylinders of quintic strips along a path, from circle to circle.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/vector.h"
#include "kernel/spline/knot_vector.h"
#include "modeling/body/path.h"

namespace angiospline {

// Control points of a quintic Bezier arc.
using Arc = Eigen::Matrix<double, 3, 6>;

// A circle at which a body begins or ends. Its arcs run clockwise seen from in front of `tangent`
// (so that Su x Sv points outward), each beginning where the one before ends, the last ending where
// the first begins. Neighbouring arcs have equal derivatives where they meet.
struct BodyEnd {
  Vec3 center_mm = Vec3::Zero();
  Vec3 tangent = Vec3::Zero();  // unit, along the body's travel
  double radius_mm = 0.0;
  std::vector<Arc> arcs;
  bool joined =
      false;  // the surface goes on beyond: the body leaves or arrives exactly along tangent
};

// The end of a path that nothing continues, at parameter t (0 or 1); without arcs.
BodyEnd free_end(const BSplineCurve<4>& path, double t);

// A circle of two equal arcs about `center`; the first begins at `center + radius * seam`. Radial
// error 1.8e-6 of the radius. Requires unit, orthogonal vectors.
std::vector<Arc> two_arc_circle(const Vec3& center_mm, double radius_mm, const Vec3& tangent,
                                const Vec3& seam);

// A stretch of one arc of an end.
struct ArcPart {
  int arc = 0;
  double from = 0.0;
  double to = 1.0;
  bool whole() const { return from == 0.0 && to == 1.0; }
};

// One patch of the body, as it lies on the arcs of both ends.
struct BodyStrip {
  ArcPart start;
  ArcPart end;
};

// Control point c of row i is column i * ring() + c; strip k uses points 5k .. 5k + 5 of each row,
// cyclically. All strips are Bezier of degree 5 in v and share the knots of u.
// Laws: row 0 and the last row lie on the arcs of the ends; at a joined end the next row is theirs
// plus a positive affine multiple of the tangent, so that the cross derivative is along the tangent
// everywhere; across every seam the cross derivatives of two strips are in one fixed ratio, so that
// their tangent planes agree exactly.
struct Body {
  KnotVector u = KnotVector::bezier(5);  // over [0, 1]
  std::vector<BodyStrip> strips;
  Points3 net;
  double deviation = 0.0;       // of the control net from the sweep, in radii: bounds the surface's
  double twist_rad = 0.0;       // by which seams turn between the ends beyond the frame
  double jacobian_ratio = 0.0;  // least (Su x Sv) . outward over its mean; negative: folded

  int ring() const { return 5 * static_cast<int>(strips.size()); }
  int rows() const { return u.control_point_count(); }
};

struct BodyOptions {
  double tolerance = 0.01;  // of the control net from the sweep, in local radii
};

// Sweeps the ends' arcs along the path, at right angles to it, in a rotation-minimising frame;
// seams of the ends are matched for the least twist, and the twist is spread along the body. Ends
// with different numbers of arcs are split at the union of their seams (a + b - gcd(a, b) strips).
// Knots are added by bisection until `tolerance` holds. A default BodyEnd{} is a free end where the
// path ends; without arcs it takes its seams from the other end; if neither has any, two arcs.
// Requires the path to begin and end at the ends.
// Linear in length / radius. Reference: Wang, Juettler, Zheng, Liu, Computation of Rotation
// Minimizing Frames, ACM TOG 2008 (the double reflection).
Body make_body(const BodyPath& path, BodyEnd start, BodyEnd end, const BodyOptions& options = {});

// The short cut for ends too near each other for a sweep: one span, each point of one circle led to
// its partner on the other by a cubic that leaves along the tangents. Keeps the laws of Body; its
// cross-sections are circles only at the ends. Requires arcs at both ends, and tangents less than a
// right angle apart.
Body make_lofted_body(const BodyEnd& start, const BodyEnd& end);

// Weights (row: new control point, column: old one) of the part [from, to] of a quintic Bezier arc.
Eigen::Matrix<double, 6, 6> arc_part_weights(double from, double to);

}  // namespace angiospline
