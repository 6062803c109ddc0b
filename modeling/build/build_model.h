// From a centerline tree to a model: junctions, bodies, rims; what fails is named, the rest is
// kept.
#pragma once

#include <optional>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/junction/junction.h"
#include "modeling/network/model.h"
#include "modeling/tree/smooth_centerlines.h"

namespace angiospline {

struct BuildOptions {
  SmoothingOptions smoothing;
  JunctionOptions junction;
  double body_tolerance = 0.01;  // of a body against its smoothed centerline and radius, in radii

  // Straight round tubes added at free ends, along the vessel, in local diameters; 0: none. Ends
  // where the direction of flow is not known count as outlets.
  double extend_inlets = 0.0;
  double extend_outlets = 0.0;

  // Vessels are moved apart and thinned until their walls keep this distance, in radii of the
  // thinner one (modeling/tree/keep_apart.h). Unset: they stay as the tree has them.
  std::optional<double> clearance;
};

// The surface network of a whole tree. Rims are named "inlet" ("inlet_<node>" when there are
// several) and "outlet_<node>", regions "wall_<branch>" and "junction_<node>", and
// "extension_<rim>" for what was added beyond an end. A branch or junction
// that cannot be built is listed in Model::failed and the network closes around it. Errors: nothing
// at all could be built; stopped on request.
Result<Model> build_model(const CenterlineTree& tree, const BuildOptions& options = {},
                          const Progress& progress = {});

// The first half of it: the tree rounded to what no unit of length changes
// (modeling/tree/clean_tree.h), smoothed and, if asked for, kept apart.
Result<SmoothedTree> smooth_for_build(const CenterlineTree& tree, const BuildOptions& options = {},
                                      const Progress& progress = {});

// A model and the smoothed tree it is true to: the one it was made of, thinned where there was no
// room (modeling/build/make_room.h).
struct BuiltModel {
  Model model;
  SmoothedTree tree;
};

// The second half: from a tree that is smooth already. Junctions that swallow each other or that
// cannot be built for being several in one are cut, and vessels thinned there; warnings name them.
Result<BuiltModel> build_with_room(SmoothedTree tree, const BuildOptions& options = {},
                                   const Progress& progress = {});

// The same with every vessel as thick as it is.
Result<Model> build_smoothed(const SmoothedTree& tree, const BuildOptions& options = {},
                             const Progress& progress = {});

}  // namespace angiospline
