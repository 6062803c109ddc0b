// How the arcs of a body's two ends become one set of strips, and what lies between them.
#pragma once

#include <array>
#include <vector>

#include "modeling/body/body.h"

namespace angiospline {

// A place along a body: the plane of its cross-section.
struct Station {
  Vec3 center;
  Vec3 e1, e2;  // e1 x e2 = tangent
  double radius;

  // The body's own plane coordinates: angles grow clockwise about the tangent.
  Vec2 local(const Vec3& p) const {
    return Vec2((p - center).dot(e1), -(p - center).dot(e2)) / radius;
  }
  Vec3 world(const Vec2& q) const { return center + radius * (q.x() * e1 - q.y() * e2); }
};

// One end of one strip in its plane: what is blended between the ends.
struct StripShape {
  double share = 0;                        // of the turn: the strip's width in the common parameter
  double seam_angle = 0, seam_radius = 1;  // of the first point
  Vec2 seam_speed = Vec2::Zero();          // radial, tangential derivative in the common parameter
  std::array<double, 2> angle{}, radius{};  // of the two middle control points
};

using RingShape = std::vector<StripShape>;

// The pair of seams that, laid on each other, turn least along the body.
struct SeamMatching {
  std::vector<BodyStrip> strips;
  RingShape start, end;
  double twist_rad;
};

// The common strips of both ends for that pair; stations in frames carried along the body.
SeamMatching match_seams(const BodyEnd& start, const BodyEnd& end, const Station& first,
                         const Station& last);

// The ring's control points (5 a strip) in a plane between the ends, w from 0 at the start to 1 at
// the end. Across a seam both neighbours take their tangents from one vector, times their own
// shares of the turn: the ratio is the same everywhere along the body.
std::vector<Vec2> blend_rings(const RingShape& start, const RingShape& end, double w);

// The control points of an end's ring, exactly on its arcs: 5 a strip.
Points3 ring_on_arcs(const std::vector<BodyStrip>& strips, const BodyEnd& end, bool at_start);

}  // namespace angiospline
