// Tangent-plane continuity of bodies that were moved: along their seams and where they join.
#pragma once

#include <vector>

#include "modeling/network/surface_network.h"

namespace angiospline {

// A closed ring of strips, each V1 on the next one's V0: a body as assembled. Its row i is the
// points i * 6 + j, j < 5, of the strips' control, one strip after the other.
struct BodyRing {
  std::vector<int> strips;  // patches
  int region = -1;
};

// All rings whose strips have six points across, in the order of their first strips.
std::vector<BodyRing> body_rings(const SurfaceNetwork& network);

// Moves control points of the ring so that the laws of Body hold again, each by the shortest way:
//   rims lie in their planes;
//   corners of the openings it joins move to half way between their neighbours;
//   the rows beside a joined end go along one direction, the mean of both sides', the body's by an
//   affine multiple of it; and
//   seam points move to between their neighbours, in the ratio they have at the joined end.
// What is held: all else, and dependent points follow their masters. With these laws the normals
// agree exactly along all seams and joined ends; the patches beyond an opening are not looked at
// otherwise. Returns the regions beyond its ends whose control points moved.
std::vector<int> mend_body(SurfaceNetwork& network, const BodyRing& ring);

}  // namespace angiospline
