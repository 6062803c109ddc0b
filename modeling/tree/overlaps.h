// Vessels that touch or run into each other away from the junctions that join them.
#pragma once

#include <string>
#include <vector>

#include "modeling/tree/smooth_centerlines.h"

namespace angiospline {

// Where two branches (or one and itself) overlap the most.
struct Overlap {
  int first = -1;  // index of a branch; first <= second
  int second = -1;
  Vec3 at_mm = Vec3::Zero();  // between the two centerlines
  double depth_mm = 0.0;  // sum of the radii and the clearance less the distance of the centerlines
};

struct OverlapOptions {
  double clearance = 0.0;  // also report vessels closer than this, in radii of the thinner one
};

// One entry for each pair of branches that overlap, ordered by their indices. Branches that meet at
// a node (or at nodes joined by a branch no longer than its junctions are wide) overlap there by
// right: only what lies behind the first gap along both of them counts, and where one that has left
// their node comes back to the other after a way of more than 2.5 radii, apart from what overlaps
// there. A branch overlaps itself where it comes back after three diameters. Vessels are taken
// as chains of capsules, half a radius long. O(n) for n capsules of vessels that do not pile up, by
// one grid for each octave of sizes.
std::vector<Overlap> find_overlaps(const SmoothedTree& tree, const OverlapOptions& options = {});

// One place where two vessels are nearer than they may be.
struct PathContact {
  int first = -1;
  int second = -1;
  double first_along = 0.0;  // on their paths
  double second_along = 0.0;
  Vec3 first_mm = Vec3::Zero();  // on their centerlines
  Vec3 second_mm = Vec3::Zero();
  double depth_mm = 0.0;
};

// All pairs of capsules behind find_overlaps, ordered by pairs of branches.
std::vector<PathContact> find_path_contacts(const SmoothedTree& tree,
                                            const OverlapOptions& options = {});

// "branches 12_40 and 33_35 overlap by 0.41 mm near (1.2, 3.4, 5.6)".
std::string overlap_text(const SmoothedTree& tree, const Overlap& overlap);

}  // namespace angiospline
