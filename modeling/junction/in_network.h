// A junction's template, found again among the patches of a network.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "modeling/junction/unknowns.h"
#include "modeling/layout/layout.h"
#include "modeling/layout/topology.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

struct JunctionInNetwork {
  std::string name;  // of its region
  JunctionTopology topology;
  std::vector<int> patches;  // of the network, one for each of the topology's
  std::vector<int> columns;  // of the network's pool, one for each point of SharedGrid(topology, 6)
  Vec3 center_mm = Vec3::Zero();  // mean of its control points
  double radius_mm = 0.0;         // the region's: the unit of net and layout below
};

// How the region's patches meet. Poles get the direction in which they lie from the centre,
// branches are numbered in the order in which their patches come. Errors, by region and patch: no
// patches, a patch that is not a bi-quintic Bezier patch over the unit square, sides that do not
// meet as those of a junction do (see JunctionPatch) or do not share their control points. Linear
// in the network.
Result<JunctionInNetwork> junction_in_network(const SurfaceNetwork& network, int region);

// The surface as it stands, as a layout to keep to: nodes on the patches, normals averaged where
// patches meet, openings about the mean direction in which the surface leaves them.
JunctionLayout present_layout(const JunctionInNetwork& junction, const SurfaceNetwork& network);

// The control points as they stand, about the centre and in radii; the row next to each opening is
// projected onto the opening's axis, along which it slides.
JunctionNet present_net(const JunctionInNetwork& junction, const JunctionLayout& layout,
                        const SurfaceNetwork& network);

}  // namespace angiospline
