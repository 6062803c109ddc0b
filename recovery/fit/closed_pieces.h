// Pieces of a mask that are no vessels: a sac or a blob has no branch and becomes a closed surface.
#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "modeling/network/model.h"
#include "recovery/fit/fit_model.h"
#include "recovery/imaging/image/image.h"

namespace angiospline {

// A tree without the branches of pieces that are no vessels, and those pieces as a mask.
struct TreeAndPieces {
  CenterlineTree tree;
  Mask pieces;
};

// A 26-connected piece of `mask` is no vessel if the skeleton has at most one voxel in it, or if
// all that runs through it is one branch no longer than 1.5 of its diameters and the piece does not
// reach the image's border, where a vessel would be cut; and it has 30 voxels or more. Where that
// would leave no branch the tree stays whole. Requires a tree and a skeleton that come from the
// mask. O(voxels + branches).
TreeAndPieces part_closed_pieces(const Mask& mask, const Mask& skeleton,
                                 const CenterlineTree& tree);

// Appends a closed surface for each piece (recovery/fit/closed_surface.h) to the model's network,
// as regions "wall_closed_1" and so on, the largest first. With an image they are fitted to it;
// where that cannot be done they stay ellipsoids, with a warning. An assumption says how many.
// Nothing happens for an empty mask. Error: stopped on request.
Result<void> add_closed_pieces(Model& model, const Mask& pieces, const Image<float>* image,
                               const FitOptions& options = {}, const Progress& progress = {});

}  // namespace angiospline
