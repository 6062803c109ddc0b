// Junctions and bodies put together: one pool of control points, joins, rims and names.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "modeling/body/body.h"
#include "modeling/junction/junction.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

// What lies beyond an end of a body: an opening of a junction, a circle shared with another body
// (a closed ring is two bodies on two circles), or nothing: a rim.
struct BodyLink {
  enum class Kind { kRim, kOpening, kCircle };
  Kind kind = Kind::kRim;
  int junction = -1;  // kOpening: index into the junctions, and the opening's number there
  int opening = -1;
  int circle = -1;  // kCircle: bodies with the same number share it, one's end and one's start
  std::string rim_name;
  RimKind rim_kind = RimKind::kCap;
};

struct BodyPiece {
  Body body;
  std::string name;        // of its region: "wall_<branch>"; pieces with one name share a region
  double radius_mm = 0.0;  // the smallest on the piece
  BodyEnd start;           // as given to make_body; for a rim: the circle of the cap
  BodyEnd end;
  BodyLink start_link;
  BodyLink end_link;
  std::optional<BSplineCurve<4>> path;  // the axis and radius over [0, 1], where it was swept
};

// An opening without a body: it is closed by a plane cap of its own.
struct ClosedOpening {
  int junction = -1;
  int opening = -1;
  std::string rim_name;
  RimKind rim_kind = RimKind::kCap;
};

// The end of a body at a junction's opening. `leaving`: the body starts there.
BodyEnd opening_end(const Junction& junction, int opening, bool leaving);

// The network of all pieces; regions come in the order of junctions, then bodies. Where a strip
// covers a whole arc of an opening it uses the junction's pool columns; where it covers a part, its
// columns are Dependencies of them. Every opening must be named by one body or by one of `closed`.
// Linear in the pieces' size.
SurfaceNetwork assemble(const std::vector<Junction>& junctions,
                        const std::vector<BodyPiece>& bodies,
                        const std::vector<ClosedOpening>& closed = {});

}  // namespace angiospline
