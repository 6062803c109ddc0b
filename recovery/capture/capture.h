// Centerlines and radii moved to the image: the first stage of a fit, with few degrees of freedom.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/tree/centerline_tree.h"
#include "recovery/wall/wall_profile.h"

namespace angiospline {

struct CapturedTree {
  CenterlineTree tree;                  // names and topology as given
  int rounds = 0;                       // of measurement
  double mean_move_mm = 0.0;            // of the axes, over all places that were measured
  std::vector<std::string> left_alone;  // branches near which no wall was found: as given
  std::vector<std::string> recaptured;  // branches that had to be found again from farther off
};

// Cross-sections along each branch are moved and resized to the wall: the mean of the wall's
// offsets (recovery/wall/wall_profile.h) around a section changes its radius, their first harmonic
// moves its centre. A branch whose sections do not lie on the vessel is first led there by the
// moments of grey within discs of one and a half radii and three voxels: their area gives the
// radius, their centroid the axis. Sections within reach of another branch of the same junction are
// not measured but follow; ends stay in their planes. The last round's sections are returned as
// they were measured, for smooth_centerlines() to choose how smooth they are. Errors: those of
// smooth_centerlines; stopped on request.
Result<CapturedTree> capture_tree(const CenterlineTree& tree, const GreyField& field,
                                  const Progress& progress = {});

}  // namespace angiospline
