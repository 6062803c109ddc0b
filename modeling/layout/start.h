// Where the relaxation of a junction's layout begins: seams, crossings and poles from the spherical
// Voronoi diagram of the branches' directions.
#pragma once

#include <vector>

#include "base/vector.h"
#include "modeling/layout/layout.h"
#include "modeling/layout/target.h"
#include "modeling/layout/topology.h"

namespace angiospline {

// Where a saddle crosses between its branches.
struct SaddleCrossing {
  Vec3 direction = Vec3::Zero();  // unit, from the centre
  double distance = 0.0;  // of the crotch of the two cylinders, at most that of the nearer opening
};

struct LayoutStart {
  std::vector<SaddleCrossing> crossings;  // one a saddle
  std::vector<Vec3> poles;                // unit directions, one a pole
  std::vector<OpeningFrame> openings;     // one a branch, seams turned towards their poles
};

// `distances` are those of the openings along their branches, from where these begin.
LayoutStart layout_start(const JunctionTopology& topology, const JunctionTarget& target,
                         const std::vector<double>& distances);

// Seams near the wanted azimuths (increasing, less than a turn apart) whose sectors keep between
// half and twice their equal share of the turn, at most half of it; two sectors are always halves.
// O(count).
std::vector<double> bounded_seams(const std::vector<double>& wanted_rad);

// The azimuth of a point about the frame's axis, from -pi to pi.
double opening_azimuth(const OpeningFrame& frame, const Vec3& x);

// The angle less whole turns: from -pi to pi.
double wrapped_angle(double angle_rad);

}  // namespace angiospline
